"""Random solids with exact spectra, kept in files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from mpi4py import MPI

from carillon.progress import say, track
from solver.analysis import SolverOptions, modal_analysis
from solver.calibration.cases import Case, write_case
from solver.calibration.solids import random_solid
from solver.coarsening import CoarseMaterial, block_moduli, coarse_model
from solver.geometry import blocks_from_mesh
from solver.model import RIGID_MODES, fine_model

MODES = 60
"""Modes of a case, rigid ones included."""

LARGEST = 2400
"""Coarse models with more unknowns are left out: many small solids say more than a few large."""


def _made(seed: int, number: int) -> Case | None:
    mesh, young, material = random_solid(seed, number)
    blocks = blocks_from_mesh(mesh)
    e = block_moduli(blocks, young)
    coarse = coarse_model(blocks, CoarseMaterial(np.ones_like(e), 0.0))
    if coarse.n_dofs > LARGEST or coarse.n_dofs < 3 * MODES:
        return None
    options = SolverOptions(method="slepc", modes=MODES, prove=False)
    result = modal_analysis(fine_model(mesh, young), options, MPI.COMM_SELF)
    result.system.destroy()
    return Case(f"{number}-{material}", coarse, e, np.sqrt(result.values[RIGID_MODES:]))


def make_cases(folder: Path, seed: int, count: int) -> list[Path]:
    """Files of `count` cases in `folder`; those that are there already are not made again.

    Raises
    ------
    UserError
        If a file cannot be written, or one that is there is damaged.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths = list(track(_numbered(folder, seed, count), "exact spectra", total=count, unit="solid"))
    say(f"{len(paths)} solids with exact spectra in {folder}")
    return paths


def _numbered(folder: Path, seed: int, count: int) -> Iterator[Path]:
    number = found = 0
    while found < count:
        path = folder / f"seed-{seed}-solid-{number:04d}.h5"
        skipped = path.with_suffix(".skipped")
        if not path.exists() and not skipped.exists():
            case = _made(seed, number)
            if case is None:
                skipped.touch()
            else:
                write_case(path, case)
        if path.exists():
            found += 1
            yield path
        number += 1
