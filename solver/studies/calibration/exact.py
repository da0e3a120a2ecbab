"""Random solids with exact spectra, kept in files."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from carillon.fem.geometry import (
    HexMesh,
    blocks_from_mesh,
    hexmesh_from_voxels,
    load_surface,
    voxelize,
)
from carillon.fem.geometry.builtin import BUILTINS
from carillon.fem.materials import NAMES, young_modulus
from carillon.fem.model import RIGID_MODES, fine_model
from carillon.progress import track
from solver.analysis.modal_solver import modal_analysis
from solver.analysis.options import SolverOptions
from solver.studies.calibration.cases import SpectrumCase, write_case
from solver.studies.calibration.solids import random_solid

logger = logging.getLogger(__name__)

MODES = 60
"""Modes of a case, rigid ones included."""

Array = NDArray[np.float64]

LARGEST = 3000
"""Coarse models with more unknowns are left out: many small solids say more than a few large."""


OBJECT_RESOLUTIONS = (20, 27)
"""Voxels along the longest side of the built-in objects, which are cases as well."""


def _case(name: str, mesh: HexMesh, young: Array) -> SpectrumCase | None:
    """Case of a solid, None if it is too large or too small."""
    coarse = blocks_from_mesh(mesh).coarse
    if coarse.n_dofs > LARGEST or coarse.n_dofs < 3 * MODES:
        return None
    options = SolverOptions(method="slepc", modes=MODES)
    result = modal_analysis(fine_model(mesh, young), options, MPI.COMM_SELF)
    result.system.destroy()
    exact = np.sqrt(result.values[RIGID_MODES:])
    return SpectrumCase.of_solid(name, mesh, young, exact)


def _object(name: str, resolution: int, material: str) -> SpectrumCase | None:
    voxels = voxelize(load_surface(f"builtin:{name}"), resolution, components="largest", name=name)
    mesh = hexmesh_from_voxels(voxels)
    return _case(f"{name}:{material}", mesh, young_modulus(material, mesh))


def _random(seed: int, number: int) -> SpectrumCase | None:
    mesh, young, material = random_solid(seed, number)
    return _case(f"random:{material}", mesh, young)


def make_cases(folder: Path, seed: int, count: int, objects: bool = True) -> list[Path]:
    """Files of `count` random solids and of the built-in objects, each with every material.

    Files that are in `folder` already are not made again.

    Raises
    ------
    UserError
        If a file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    expected = len(BUILTINS) * len(OBJECT_RESOLUTIONS) * len(NAMES) if objects else 0
    with_progress = track(
        _made(folder, seed, count, objects), "exact spectra", total=expected + count, unit="solid"
    )
    paths = [path for path in with_progress if path is not None]
    logger.info(f"{len(paths)} solids with exact spectra in {folder}")
    return paths


def _made(folder: Path, seed: int, count: int, objects: bool) -> Iterator[Path | None]:
    if objects:
        for name, resolution, material in product(BUILTINS, OBJECT_RESOLUTIONS, NAMES):
            path = folder / f"{name}-{resolution}-{material}.h5"
            yield _kept(path, partial(_object, name, resolution, material))
    number = done = 0
    while done < count:
        path = folder / f"seed-{seed}-solid-{number:04d}.h5"
        made = _kept(path, partial(_random, seed, number))
        number += 1
        if made is not None:
            done += 1
            yield made


def _kept(path: Path, make: Callable[[], SpectrumCase | None]) -> Path | None:
    """The file of a case, made if it is not there; None if the case is too large or too small."""
    skipped = path.with_suffix(".skipped")
    if skipped.exists():
        return None
    if not path.exists():
        case = make()
        if case is None:
            skipped.touch()
            return None
        write_case(path, case)
    return path
