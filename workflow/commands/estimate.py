"""Command line of the estimate: `python -m workflow estimate`."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Annotated, Any

import pandas as pd

from carillon.fem.geometry import surface_name
from carillon.files.atomic import atomic_path
from carillon.files.paths import require_writable
from carillon.parameters.command_line import reader
from carillon.parameters.quantities import between
from carillon.processes.cores import allowed_cores
from dataset_gen.objectives import DATASET_OBJECTIVES
from workflow import settings
from workflow.estimate import summary
from workflow.estimate.costs import Machine, costs
from workflow.estimate.laws import Rates
from workflow.estimate.plan import plan
from workflow.estimate.rates import PACKAGED, checked, load_rates
from workflow.estimate.sizes import is_solved_in_full, options_of, solid_of
from workflow.estimate.solids import NamedSolid, Size, size_of

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
    parser.add_argument(
        "--nodes",
        type=reader(Annotated[int, between(1, MOST_NODES)]),
        default=1,
        help="(default 1)",
    )
    parser.add_argument(
        "--cores-per-node",
        type=reader(Annotated[int, between(1, MOST_CORES)]),
        default=allowed_cores(),
        metavar="CORES",
        help="(default: those of this machine)",
    )
    parser.add_argument("--rates", metavar="FILE", help="rates to use, or to write with --measure")
    parser.add_argument(
        "--measure", action="store_true", help="measure the rates here first, in some minutes"
    )
    parser.add_argument("--json", action="store_true", help="with the basis of every number")


def run(arguments: argparse.Namespace) -> int:
    """Print the estimate.

    Raises
    ------
    UserError
        For a bad configuration or bad rates, or if a solid cannot be voxelised.
    """
    preset = CONFIGURATIONS / f"{arguments.preset or DEFAULT_PRESET}.yaml"
    path = preset if arguments.configfile is None else Path(arguments.configfile)
    config = load(path, arguments.objective)
    rates = _rates(arguments.rates, arguments.measure)
    machine = Machine(arguments.nodes, arguments.cores_per_node)
    jobs, solids = estimate(config, rates, machine)
    run_name = "make run" if path == CONFIGURATIONS / f"{DEFAULT_PRESET}.yaml" else "target all"
    result = {
        "configuration": str(path),
        "run_name": run_name,
        **summary.plain(jobs, solids, rates, machine),
    }
    if path.stem == PAPER:
        result["paper"] = summary.beside_the_paper(jobs, machine)
    objective = config["dataset"]["objective"]
    text = summary.as_text(result, f"{path.stem}, objective {objective},")
    print(json.dumps(result, indent=2) if arguments.json else text)
    return 0


def load(path: Path, objective: str | None = None) -> dict[str, Any]:
    """A configuration with its defaults; meshes may be absent.

    Raises
    ------
    UserError
        If it cannot be read, or holds anything that does not fit.
    """
    return settings.complete([path], {"dataset": {"objective": objective}} if objective else {})


def estimate(
    config: dict[str, Any], rates: Rates, machine: Machine
) -> tuple[pd.DataFrame, dict[str, Size]]:
    """What every job takes, see `costs`, and the unknowns of all solids by name and resolution.

    Raises
    ------
    UserError
        If a solid cannot be voxelised, or the rules do not accept the configuration.
    """
    jobs = plan(config, machine.cores_per_node, machine.cores)
    solids = filter(None, dict.fromkeys(map(solid_of, jobs["command"])))
    named = {f"{surface_name(each.mesh)} {each.resolution}": _sized(each, jobs) for each in solids}
    return costs(jobs, rates, machine), named


def _sized(solid: NamedSolid, jobs: pd.DataFrame) -> Size:
    """Unknowns of a solid, and the materials with which its coarsening would not pay."""
    commands = [each for each in jobs["command"] if solid_of(each) == solid]
    in_full = {options_of(each)["material"] for each in commands if is_solved_in_full(each)}
    return size_of(solid)._replace(in_full=tuple(sorted(in_full)))


def _rates(path: str | None, here: bool) -> Rates:
    if not here:
        return load_rates(PACKAGED if path is None else path)
    from workflow.estimate.measure import measure

    if path is not None:
        require_writable(path)
    rates = checked(measure(), "the rates measured")
    if path is not None:
        with atomic_path(path) as temporary:
            temporary.write_text(json.dumps(rates, indent=2) + "\n")
    return rates
