"""Command line of the estimate: `python -m workflow estimate`."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from carillon.arguments import whole_number
from carillon.files import require_writable
from carillon.runtime import allowed_cores
from dataset_gen.objectives import DATASET_OBJECTIVES
from workflow import settings, training
from workflow.estimate import summary
from workflow.estimate.machine import Machine
from workflow.estimate.rates import PACKAGED, Rates, load_rates, rates_of, save_rates
from workflow.estimate.sizes import Size, Sizes, size_of
from workflow.estimate.solver_stages import SolverStages
from workflow.estimate.stages import Run, Stage
from workflow.estimate.training_stages import TrainingStages

CONFIGURATIONS = Path(__file__).parent.parent / "config"
DEFAULT_PRESET, PAPER = "laptop", "paper"
MOST_NODES, MOST_CORES = 100_000, 10_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        "Core-hours, wall time, memory and storage of the default run and of target figures, from "
        "rates that were measured on one core. Jobs, ranks and shards are as the rules make them."
    )
    chosen = parser.add_mutually_exclusive_group()
    chosen.add_argument(
        "--preset",
        choices=sorted(path.stem for path in CONFIGURATIONS.glob("*.yaml")),
        help=f"configuration that comes along (default {DEFAULT_PRESET})",
    )
    chosen.add_argument("--configfile", metavar="FILE", help="any other configuration")
    parser.add_argument(
        "--objective", choices=DATASET_OBJECTIVES, help="instead of dataset.objective"
    )
    parser.add_argument("--nodes", type=whole_number(1, MOST_NODES), default=1, help="(default 1)")
    parser.add_argument(
        "--cores-per-node",
        type=whole_number(1, MOST_CORES),
        default=allowed_cores(),
        metavar="CORES",
        help="(default: those of this machine)",
    )
    parser.add_argument("--rates", metavar="FILE", help="rates to use, or to write with --measure")
    parser.add_argument(
        "--measure", action="store_true", help="measure the rates here first, about three minutes"
    )
    parser.add_argument("--json", action="store_true", help="with the basis of every number")


def run(arguments: argparse.Namespace) -> int:
    """Print the estimate.

    Raises
    ------
    UserError
        For a bad configuration or bad rates, or if a solid cannot be voxelised.
    """
    file, preset = arguments.configfile, arguments.preset or DEFAULT_PRESET
    path = _preset(preset) if file is None else Path(file)
    config = load(path, arguments.objective)
    rates = _rates(arguments)
    machine = Machine(arguments.nodes, arguments.cores_per_node)
    stages, sizes = estimate(config, rates, machine)
    found = {"configuration": str(path), **summary.plain(stages, sizes, rates, machine)}
    if path.stem == PAPER:
        found["paper"] = summary.beside_the_paper(stages, machine)
    if arguments.json:
        print(json.dumps(found, indent=2))
    else:
        objective = config["dataset"]["objective"]
        print(summary.as_text(found, f"{path.stem}, objective {objective},"))
        if "paper" in found:
            print(found["paper"])
    return 0


def load(path: Path, objective: str | None = None) -> dict[str, Any]:
    """A configuration with its defaults; meshes may be absent.

    Raises
    ------
    UserError
        If it cannot be read, or holds anything that does not fit.
    """
    from snakemake.utils import validate  # Takes long to import, and --help should not.

    config = settings.read([path], {})
    settings.check(config)
    validate(config, str(settings.SCHEMA))
    if objective is not None:
        config["dataset"]["objective"] = objective
    training.own(config).check()
    return dict(config)


def estimate(
    config: dict[str, Any], rates: Rates, machine: Machine, sizes: Sizes = size_of
) -> tuple[list[Stage], dict[str, Size]]:
    """All stages in order, and the unknowns of all solids by name and resolution."""
    context = Run(config, rates, machine)
    trained = [] if config["forests"]["model"] else TrainingStages(context).stages()
    spectra = SolverStages(context, sizes)
    models, shapes = config["models"], config["figures"]["models"]
    found = {f"{name} {models[name]['resolution']}": size for name, size in spectra.models.items()}
    found |= {f"{name} {shapes[name]['resolution']}": size for name, size in spectra.shapes.items()}
    return [*trained, *spectra.stages()], found


def _preset(name: str) -> Path:
    return CONFIGURATIONS / f"{name}.yaml"


def _rates(arguments: argparse.Namespace) -> Rates:
    if not arguments.measure:
        return load_rates(PACKAGED if arguments.rates is None else arguments.rates)
    from workflow.estimate.measure import measure

    if arguments.rates is not None:
        require_writable(arguments.rates)
    values = measure()
    if arguments.rates is not None:
        save_rates(arguments.rates, values)
    return rates_of(values, "the rates measured")
