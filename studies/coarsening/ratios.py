"""Spectra of solids of several Poisson's ratios, coarsened by forests and by fits at each ratio."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.command_line.progress import track
from carillon.fem.model import RIGID_MODES, ElasticModel
from carillon.processes.mpi import MPI
from solver.analysis.modal_solver import modal_analysis
from solver.analysis.modes import Modes
from solver.analysis.options import SolverOptions
from solver.analysis.problem import ProblemOptions, build_problem
from solver.coarsening.choice import FIT
from solver.coarsening.forest import FOREST
from solver.files.modes_file import frequencies
from solver.reference.eigensolver import installed_method
from solver.verification.matching import AUDIBLE_LAST, frequency_errors
from studies.coarsening.costs import take

OWN = "hybrid"
"""Objective that fits blocks at the ratio of the solid itself."""
COARSENINGS = (FOREST, OWN, "galerkin")
"""What is rated."""
SAID = ("mesh", "resolution", "material", "poisson")
"""What is told of a case."""
REFINED = "refined"
"""Name of what is taken with forests if blocks may stay fine."""
RATIOS = (0.0, 0.1, 0.25, 0.33, 0.45, 0.49)
"""Poisson's ratios unless told otherwise."""


def rate_ratios(
    solids: Sequence[ProblemOptions], ratios: Sequence[float], tolerance: float
) -> dict[str, Any]:
    """Frequency errors of solids by Poisson's ratio, against the fine voxels of the same ratio.

    Parameters
    ----------
    solids
        The solids; what they say of coarsening and ratio does not count.
    tolerance
        Expected error down to which blocks stay fine in the refined models, see
        `solver.refinement.coarse_or_fine.solve_coarsened`.

    Returns
    -------
    dict[str, Any]
        `refine_to`, and `rows`, one a solid and ratio: `mesh`, `resolution`, `material`, `poisson`,
        `n_dofs`, `coarse_n_dofs`, `refined_n_dofs`; by coarsening, and `refined`, errors over
        modes 7..60.
    """
    cases = [replace(solid, poisson=ratio) for solid in solids for ratio in ratios]
    rows = [_row(case, tolerance) for case in track(cases, "ratios")]
    return {"refine_to": tolerance, "rows": rows}


def _row(options: ProblemOptions, tolerance: float) -> dict[str, Any]:
    problem = build_problem(replace(options, coarsen="none"))
    fine = problem.hexahedra
    exact = _hertz(fine)
    models = {
        name: build_problem(_coarsened(options, name), problem.surface).hexahedra
        for name in COARSENINGS
    }
    forest = _coarsened(options, FOREST).coarsening()
    assert forest is not None
    taken = take(fine, forest, tolerance, _options(fine))
    refined = _frequencies(taken.found.modes)
    return {
        **{name: getattr(options, name) for name in SAID},
        "n_dofs": fine.n_dofs,
        "coarse_n_dofs": models[FOREST].n_dofs,
        **{name: _errors(_hertz(model), exact) for name, model in models.items()},
        REFINED: _errors(refined, exact),
        "refined_n_dofs": fine.n_dofs if taken.found.reason else taken.refined.n_dofs,
    }


def _coarsened(options: ProblemOptions, name: str) -> ProblemOptions:
    if name == OWN:
        return replace(options, coarsen=FIT, objective=OWN)
    return replace(options, coarsen=name)


def _options(model: ElasticModel) -> SolverOptions:
    return SolverOptions(method=installed_method(), modes=min(AUDIBLE_LAST, model.n_dofs))


def _hertz(model: ElasticModel) -> Array:
    return _frequencies(modal_analysis(model, _options(model), MPI.COMM_SELF))


def _frequencies(modes: Modes) -> Array:
    hertz = frequencies(modes.values)[RIGID_MODES:AUDIBLE_LAST]
    modes.destroy()
    return hertz


def _errors(hertz: Array, exact: Array) -> dict[str, Any]:
    count = min(len(hertz), len(exact))
    errors = hertz[:count] / exact[:count] - 1.0
    return asdict(frequency_errors(errors, RIGID_MODES + count))


def lines_of(result: dict[str, Any]) -> list[str]:
    """The result of `rate_ratios` as a table, line by line, with the rms over all solids last."""
    columns, rows = (*COARSENINGS, REFINED), result["rows"]
    heads = "".join(f"{name:>18s}" for name in columns)
    lines = [
        "rms and worst frequency error of modes 7 to 60 against fine voxels of the same ratio",
        f"{'':16s} {'ratio':>6s}{'unknowns':>10s}{'coarse':>8s}{heads}",
    ]
    for row in rows:
        errors = "".join(f"{row[name]['rms']:9.1%} {row[name]['worst']:+8.1%}" for name in columns)
        begin = f"{row['mesh'][-16:]:16s} {row['poisson']:6.3g}"
        lines.append(f"{begin}{row['n_dofs']:10,}{row['coarse_n_dofs']:8,}{errors}")
    for ratio in dict.fromkeys(row["poisson"] for row in rows):
        same = [row for row in rows if row["poisson"] == ratio]
        means = [np.sqrt(np.mean([row[name]["rms"] ** 2 for row in same])) for name in columns]
        lines.append(
            f"{'all':16s} {ratio:6.3g}{'':18s}" + "".join(f"{m:9.1%}{'':9s}" for m in means)
        )
    return lines
