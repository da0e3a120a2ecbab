"""Strong and weak scaling of one solid: runs on the ranks asked for, and the model beyond them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from carillon.command_line.arguments import number_between, whole_number
from carillon.command_line.options import option
from carillon.fem.elements import Elements
from carillon.fem.model import Solid
from solver import linear
from solver.analysis.options import number_of_modes, positive_tolerance
from solver.analysis.problem import ProblemOptions, build_problem
from solver.correction.correction import INTERACTIVE_TOLERANCE
from solver.distribution.decomposition import decompose
from studies.scaling.launch import MOST_RANKS, measure_each, require_ranks
from studies.scaling.model import (
    ASSUMPTIONS,
    WEAK_ASSUMPTIONS,
    CorrectionWork,
    MachineRates,
    as_far_as_it_fits,
    fit_machine,
    predict,
    work_of_busiest,
)
from studies.scaling.sizes import TreeSizes, sizes_of_box, sizes_of_solid
from studies.scaling.work import Factorisation, elimination

PREDICTED = tuple(1 << power for power in range(11))
"""Numbers of ranks that the model is asked for: 1 to 1024."""
FEWEST_CELLS = 4
"""Cells that a subdomain should have; the model stops where there would be fewer."""
NOTE = "A model, not a measurement; see its assumptions and how far it is from the measurements."

Result = dict[str, Any]


def rank_counts(text: str) -> tuple[int, ...]:
    """Argument type: numbers of ranks, separated by commas, each once and ascending."""
    return tuple(sorted({whole_number(1, MOST_RANKS)(part) for part in text.split(",")}))


@dataclass(frozen=True)
class ScalingOptions:
    """What is run and modelled."""

    modes: int = option(256, "number of modes, rigid ones included", type=number_of_modes)
    ranks: tuple[int, ...] = option(
        (1, 2), "numbers of ranks to run on, separated by commas (default 1,2)", type=rank_counts
    )
    weak: bool = option(False, "also a solid that grows with the ranks, as many unknowns a rank")
    tolerance: float = option(
        INTERACTIVE_TOLERANCE, "relative eigenvalue error to correct to", type=positive_tolerance
    )
    linear_solver: str = option(
        "mumps",
        "linear solver of the correction, the same on any number of ranks",
        choices=linear.METHODS,
    )
    latency: float | None = option(
        None,
        "of the modelled network [s] (default: measured)",
        type=number_between(1e-12, 1e3, "s"),
    )
    bandwidth: float | None = option(
        None,
        "of the modelled network [B/s] (default: measured)",
        type=number_between(1.0, 1e18, "B/s"),
    )


def scaling_study(
    options: ProblemOptions, scaling: ScalingOptions, arguments: Sequence[str]
) -> Result:
    """Run on every number of ranks, fit the model, and predict.

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

    Raises
    ------
    UserError
        For anything wrong with the solid, or if all runs fail.
    """
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
    machine = fit_machine(strong, scaling.latency, scaling.bandwidth)
    work = elimination(problem.model)
    result: Result = {
        "mesh": options.mesh,
        "resolution": options.resolution,
        "options": asdict(scaling),
        "machine": machine.as_dict(),
        "strong": {
            "runs": strong,
            "failed": failed,
            "model": _modelled(
                strong,
                _strong(problem.model, options.seed, machine, work, strong, scaling),
                ASSUMPTIONS,
            ),
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
                weak,
                _weak(problem.model.elements, machine, work, strong[0], weak),
                ASSUMPTIONS + WEAK_ASSUMPTIONS,
            ),
        }
    return result


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


def _strong(
    model: Solid,
    seed: int,
    machine: MachineRates,
    work: Factorisation,
    runs: list[Result],
    scaling: ScalingOptions,
) -> list[Result]:
    correction = CorrectionWork.measured(runs[0])
    rows = []
    sizes: TreeSizes | None = None
    most = len(model.connectivity) // FEWEST_CELLS
    for ranks in sorted({*PREDICTED, *scaling.ranks}):
        if ranks > most:
            break
        if sizes is None or ranks > sizes.tree.parts:
            sizes = sizes_of_solid(model, *decompose(model, None, seed, ranks))
        busiest = work_of_busiest(sizes, work, runs[0]["keep"], correction, ranks)
        rows.append(_row(ranks, model.n_dofs, sizes, predict(machine, busiest)))
    return rows


def _weak(
    elements: Elements,
    machine: MachineRates,
    work: Factorisation,
    alone: Result,
    runs: list[Result],
) -> list[Result]:
    correction = CorrectionWork.measured(runs[0])
    unknowns = runs[0]["n_dofs"] / runs[0]["ranks"]
    parts = 1 << max(0, round(np.log2(runs[0]["subdomains"] / runs[0]["ranks"])))
    rows = []
    for ranks in PREDICTED:
        sizes = sizes_of_box(parts * ranks, unknowns / 3.0 / parts, elements)
        grown = work.grown(ranks * unknowns / alone["n_dofs"])
        busiest = work_of_busiest(sizes, grown, runs[0]["keep"], correction, ranks)
        rows.append(_row(ranks, ranks * unknowns, sizes, predict(machine, busiest)))
    return rows


def _row(ranks: int, n_dofs: float, sizes: TreeSizes, seconds: dict[str, float]) -> Result:
    return {
        "ranks": ranks,
        "n_dofs": round(n_dofs),
        "subdomains": sizes.tree.parts,
        "seconds": seconds,
        "total": sum(seconds.values()),
    }


def _modelled(runs: list[Result], rows: list[Result], assumptions: Sequence[str]) -> Result:
    return {"note": NOTE, "assumptions": list(assumptions), **as_far_as_it_fits(runs, rows)}
