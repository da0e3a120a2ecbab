"""Command line of the estimate: `carillon estimate`."""

import argparse
import json
from pathlib import Path
from typing import Annotated, Any

from carillon.parameters.command_line import reader
from carillon.parameters.quantities import between
from carillon.processes.threads import allowed_cores
from dataset_gen.objectives import DATASET_OBJECTIVES
from workflow import settings
from workflow.estimate.costs import load_medians, with_costs, with_work
from workflow.estimate.jobs import plan
from workflow.estimate.summary import as_text, summarised

CONFIGURATIONS = Path(__file__).parent.parent / "config"
DEFAULT_PRESET = "laptop"
MOST_NODES, MOST_CORES = 100_000, 10_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        "Core-hours, wall time, memory and storage of the default run and of target figures, from "
        "what the jobs of earlier runs took. Jobs, ranks and shards are as the rules make them."
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
    parser.add_argument(
        "--results",
        metavar="FOLDER",
        action="append",
        default=[],
        help="results of a run here, whose times count in place of those that come along",
    )
    parser.add_argument("--json", action="store_true", help="with the medians it goes by")


def run(arguments: argparse.Namespace) -> int:
    """Print the estimate.

    Raises UserError for a bad configuration or bad results, or if a mesh cannot be read.
    """
    preset = CONFIGURATIONS / f"{arguments.preset or DEFAULT_PRESET}.yaml"
    path = preset if arguments.configfile is None else Path(arguments.configfile)
    default = CONFIGURATIONS / f"{DEFAULT_PRESET}.yaml"
    config = load(path, arguments.objective)
    nodes, cores = arguments.nodes, arguments.cores_per_node
    medians = load_medians(arguments.results)
    jobs = with_costs(with_work(plan(config, cores, nodes * cores), config), medians)
    result = {
        "configuration": str(path),
        "run_name": "make run" if path == default else "target all",
        "machine": {"nodes": nodes, "cores_per_node": cores},
        **summarised(jobs, nodes * cores),
        "measured": medians[medians.index.isin(jobs["kind"])].reset_index().to_dict("records"),
    }
    title = f"{path.stem}, objective {config['dataset']['objective']},"
    print(json.dumps(result, indent=2) if arguments.json else as_text(result, title))
    return 0


def load(path: Path, objective: str | None = None) -> dict[str, Any]:
    """A configuration with its defaults; meshes may be absent.

    Raises UserError if it cannot be read, or holds anything that does not fit.
    """
    return settings.complete([path], {"dataset": {"objective": objective}} if objective else {})
