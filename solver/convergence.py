"""Eigenvalues after 0, 1, 2, ... corrections from different start vectors (Fig. 10)."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from solver.analysis import RIGID_MODES, check_mode_count, default_keep
from solver.correction import correct
from solver.decomposition import on_root
from solver.distribution import Share, distribute
from solver.hcms.synthesis import synthesize
from solver.model import ElasticModel
from solver.system import assemble

Array = NDArray[np.float64]

STARTS = ("hcms-free", "hcms-fixed", "random")
PAPER_DEGREE = 1
"""Polynomial degree of a correction as in the paper: one solve a step, over-relaxed."""


def correction_history(
    model: ElasticModel | None,
    modes: int,
    steps: int,
    degree: int = PAPER_DEGREE,
    seed: int = 0,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> dict[str, Any]:
    """Elastic eigenvalues [rad^2/s^2] after each correction, by start.

    The starts are HCMS with free and with fixed interfaces, and random Gaussian vectors,
    orthogonalised, as many as HCMS keeps.  Only rank 0's `model` is looked at.
    """
    on_root(comm, lambda: check_mode_count(modes, cast(ElasticModel, model).n_dofs))
    share = distribute(model, None, seed, comm)
    system = assemble(share, comm)
    wanted = modes - RIGID_MODES
    curves = {}
    for start in STARTS:
        block = _start_block(start, share, default_keep(modes), seed, comm)
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
    return {"modes": modes, "degree": degree, "n_dofs": share.n_dofs, "start": curves}


def _start_block(start: str, share: Share, keep: int, seed: int, comm: MPI.Comm) -> Array:
    if start == "random":
        return random_block(share, keep, seed, comm)
    return synthesize(share, keep, start.removeprefix("hcms-"), comm).vectors


def random_block(share: Share, columns: int, seed: int, comm: MPI.Comm) -> Array:
    """This rank's rows (local unknowns, columns) of a Gaussian block.

    Drawn by subdomain, so that it does not depend on who owns which.
    """
    offsets = share.decomposition.offsets
    drawn = [
        np.random.default_rng([seed, part]).standard_normal(
            (3 * int(offsets[part + 1] - offsets[part]), columns)
        )
        for part in share.decomposition.subdomains_of(comm.rank)
    ]
    return np.asfortranarray(np.concatenate(drawn))
