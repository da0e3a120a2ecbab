"""Eigenvalues after 0, 1, 2, ... corrections from different start vectors (Fig. 10)."""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from solver.analysis import RIGID_MODES, check_mode_count, default_keep
from solver.correction import correct
from solver.decomposition import Decomposition, decompose
from solver.hcms.synthesis import synthesize
from solver.model import ElasticModel
from solver.system import System, assemble

Array = NDArray[np.float64]

STARTS = ("hcms-free", "hcms-fixed", "random")
PAPER_DEGREE = 1
"""Polynomial degree of a correction as in the paper: one solve a step, over-relaxed."""


def correction_history(
    model: ElasticModel,
    modes: int,
    steps: int,
    degree: int = PAPER_DEGREE,
    seed: int = 0,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> dict[str, Any]:
    """Elastic eigenvalues [rad^2/s^2] after each correction, by start.

    The starts are HCMS with free and with fixed interfaces, and random Gaussian vectors,
    orthogonalised, as many as HCMS keeps.
    """
    check_mode_count(modes, model.n_dofs)
    decomposition = decompose(model.mesh, None, seed, comm)
    system = assemble(model, decomposition, comm)
    wanted = modes - RIGID_MODES
    curves = {}
    for start in STARTS:
        block = _start_block(start, model, decomposition, system, default_keep(modes), seed)
        history: list[list[float]] = []

        def note(step: int, values: Array, rows: list[list[float]] = history) -> None:
            rows.append(values.tolist())

        correct(
            system,
            block,
            wanted,
            tolerance=0.0,
            max_steps=steps,
            degree=degree,
            observe=note,
        )
        curves[start] = history
    return {"modes": modes, "degree": degree, "n_dofs": model.n_dofs, "start": curves}


def _start_block(
    start: str,
    model: ElasticModel,
    decomposition: Decomposition,
    system: System,
    keep: int,
    seed: int,
) -> Array:
    if start == "random":
        # Drawn whole and cut by node, so that it does not depend on the number of ranks.
        whole = np.random.default_rng(seed).standard_normal((system.n_dofs, keep))
        return system.local_rows(whole)
    treatment = start.removeprefix("hcms-")
    return synthesize(model, decomposition, keep, treatment, system.comm).vectors
