"""Strong and weak scaling of one solid: runs on the ranks asked for, and the model beyond them."""

from collections.abc import Sequence
from dataclasses import asdict
from math import log2
from typing import Annotated, Any

from carillon.fem.model import Solid
from carillon.parameters import OneOf, option, parameters
from carillon.parameters.command_line import reader
from carillon.parameters.quantities import NumberOfModes, Tolerance, between
from carillon.processes import extras
from solver import linear
from solver.analysis.problem import ProblemOptions, build_problem
from solver.correction.criteria import INTERACTIVE_TOLERANCE
from solver.distribution.decomposition import decompose
from solver.distribution.tree import MergeTree
from studies.scaling.launch import MOST_RANKS, measure_each, require_ranks
from studies.scaling.model import (
    ASSUMPTIONS,
    WEAK_ASSUMPTIONS,
    MachineRates,
    as_far_as_it_fits,
    fit_machine,
)
from studies.scaling.work import Request, balanced_tree, busiest

PREDICTED = tuple(1 << power for power in range(11))
"""Numbers of ranks that the model is asked for: 1 to 1024."""
FEWEST_CELLS = 4
"""Cells that a subdomain should have; the model stops where there would be fewer."""
NOTE = "A model, not a measurement; see its assumptions and how far it is from the measurements."

Result = dict[str, Any]
Tree = tuple[MergeTree, list[float]]
"""A merge tree and the nodes of its groups."""


RankCount = Annotated[int, between(1, MOST_RANKS)]
"""A number of ranks."""


def rank_counts(text: str) -> tuple[int, ...]:
    """Argument type: numbers of ranks, separated by commas, each once and ascending."""
    return tuple(sorted(set(map(reader(RankCount), text.split(",")))))


@parameters
class ScalingOptions:
    """What is run and modelled."""

    modes: NumberOfModes = option(256, "number of modes, rigid ones included")
    ranks: tuple[RankCount, ...] = option(
        (1, 2), "numbers of ranks to run on, separated by commas (default 1,2)", read=rank_counts
    )
    weak: bool = option(False, "also a solid that grows with the ranks, as many unknowns a rank")
    tolerance: Tolerance = option(INTERACTIVE_TOLERANCE, "relative eigenvalue error to correct to")
    linear_solver: Annotated[str, OneOf(*linear.METHODS)] = option(
        "multifrontal",
        "linear solver of the correction, the same on any number of ranks",
    )
    latency: Annotated[float, between(1e-12, 1e3)] | None = option(
        None,
        "of the modelled network [s] (default: measured)",
    )
    bandwidth: Annotated[float, between(1.0, 1e18)] | None = option(
        None,
        "of the modelled network [B/s] (default: measured)",
    )


def scaling_study(
    options: ProblemOptions, scaling: ScalingOptions, arguments: Sequence[str]
) -> Result:
    """Run on every number of ranks, fit the model, and predict.

    Raises UserError for anything wrong with the solid, without mpi4py, or if all runs fail.

    Parameters
    ----------
    options
        The solid.
    arguments
        Command-line arguments of a run, without mesh and resolution.

    Returns
    -------
    Result
        Plain values: `strong` and `weak` (None unless asked for), each with `runs`, what was said
        by those that `failed`, and `model`.
    """
    extras.require(extras.MPI, "the study of scaling")
    require_ranks(max(scaling.ranks))
    problem = build_problem(options)

    def runs(resolutions: dict[int, int]) -> tuple[list[Result], dict[int, str]]:
        return measure_each(
            {
                ranks: [options.mesh, "--resolution", str(resolution), *arguments]
                for ranks, resolution in resolutions.items()
            }
        )

    strong, failed = runs(dict.fromkeys(scaling.ranks, options.resolution))
    model, most = problem.model, len(problem.model.connectivity) // FEWEST_CELLS
    asked = {*PREDICTED, *(run["ranks"] for run in strong)}
    trees = trees_of_solid(model, sorted(n for n in asked if n <= most), options.seed)
    request = Request.of_run(strong[0])
    work = {ranks: busiest(*tree, request, ranks) for ranks, tree in trees.items()}
    machine = fit_machine(
        [(run, work[run["ranks"]]) for run in strong if run["ranks"] in work],
        scaling.latency,
        scaling.bandwidth,
    )
    result: Result = {
        "mesh": options.mesh,
        "resolution": options.resolution,
        "options": asdict(scaling),
        "machine": machine.as_dict(),
        "strong": {
            "runs": strong,
            "failed": failed,
            "model": _modelled(machine, strong, trees, request, ASSUMPTIONS),
        },
        "weak": None,
    }
    if scaling.weak:
        grown = {ranks: round(options.resolution * ranks ** (1 / 3)) for ranks in scaling.ranks}
        weak, failed = runs(grown)
        result["weak"] = {
            "runs": weak,
            "failed": failed,
            "model": _modelled(
                machine,
                weak,
                growing_trees(weak[0]),
                Request.of_run(weak[0]),
                ASSUMPTIONS + WEAK_ASSUMPTIONS,
            ),
        }
    return result


def trees_of_solid(model: Solid, ranks: Sequence[int], seed: int) -> dict[int, Tree]:
    """Merge tree of a solid and the nodes of its groups, for each of ascending numbers of ranks."""
    trees: dict[int, Tree] = {}
    last: Tree | None = None
    for count in ranks:
        if last is None or count > last[0].parts:
            decomposition, _ = decompose(model, None, seed, count)
            nodes = [float(stop - start) for start, stop in decomposition.row_ranges()]
            last = decomposition.tree, nodes
        trees[count] = last
    return trees


def growing_trees(run: Result) -> dict[int, Tree]:
    """The same of solids that grow with the ranks, with the unknowns of a rank of this run."""
    nodes = run["n_dofs"] / run["ranks"] / 3.0
    levels = max(0, round(log2(run["subdomains"] / run["ranks"])))
    trees = {}
    for ranks in PREDICTED:
        tree = balanced_tree(levels + round(log2(ranks)))
        trees[ranks] = tree, [nodes / (1 << levels) * (1 << level) for level in tree.levels()]
    return trees


def study_lines(result: Result) -> list[str]:
    """A result as people read it."""
    lines = []
    for kind in ("strong", "weak"):
        part = result[kind]
        if part is None:
            continue
        lines.append(f"{kind} scaling, wall seconds")
        modelled = {row["ranks"]: row["total"] for row in part["model"]["rows"]}
        for run in part["runs"]:
            model = modelled.get(run["ranks"])
            by_model = "" if model is None else f"   model {model:8.2f} s"
            note = f"   oversubscribed: {run['cores']} cores" if run["oversubscribed"] else ""
            lines.append(
                f"{run['ranks']:6d} ranks {run['n_dofs']:>10,d} unknowns "
                f"{run['seconds']:8.2f} s{by_model}{note}"
            )
        measured = {run["ranks"] for run in part["runs"]}
        lines += [f"{ranks:6} ranks failed: {reason}" for ranks, reason in part["failed"].items()]
        lines += [
            f"{ranks:6d} ranks {'':19s} {'':10s}   model {seconds:8.2f} s"
            for ranks, seconds in modelled.items()
            if ranks not in measured
        ]
        lines.append(part["model"]["fit"])
    return lines


def _modelled(
    machine: MachineRates,
    runs: list[Result],
    trees: dict[int, Tree],
    request: Request,
    assumptions: Sequence[str],
) -> Result:
    rows = []
    for ranks, (tree, nodes) in trees.items():
        seconds = machine.predict(busiest(tree, nodes, request, ranks))
        rows.append(
            {
                "ranks": ranks,
                "n_dofs": round(3.0 * nodes[-1]),
                "subdomains": tree.parts,
                "seconds": seconds,
                "total": sum(seconds.values()),
            }
        )
    return {"note": NOTE, "assumptions": list(assumptions), **as_far_as_it_fits(runs, rows)}
