"""Modes of a solid of one material, computed once for all its sizes, moduli and densities.

A solid of the size s, Young's modulus E and density rho has the eigenvalues of that of size 1, E_0
and rho_0 times (E / E_0) (rho_0 / rho) / s^2, if Poisson's ratios agree; mass-normalised modes go
as 1 / sqrt(rho s^3).  The modes are kept in the user's cache.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from functools import cached_property

import numpy as np

from carillon import __version__
from carillon.arrays import Surface
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.model import finite_cell_model
from carillon.fem.geometry import HexMesh
from carillon.fem.geometry.walls import Wall
from carillon.fem.model import MassProperties, Solid, fine_model
from carillon.fem.regions import Regions
from sound.scenes.solved import (
    Discretised,
    SolvedSolid,
    UnsolvedSolid,
    kept,
    kept_before,
    resized,
    scaled_rigid,
)

YOUNG, DENSITY = 1e9, 1000.0
"""Young's modulus [Pa] and density [kg/m^3] of the solid whose modes are computed."""
_VERSION = 2  # counted up when other modes are found than before


class UniformSolid:
    """The solid of a surface of one material, of `YOUNG`, `DENSITY` and a Poisson's ratio.

    Raises, when it is asked for anything, UserError if the surface encloses nothing, walls too
    thin, or several pieces.
    """

    def __init__(
        self, surface: Surface | Wall, name: str, how: Discretised, poisson: float
    ) -> None:
        regions = Regions.one(poisson, DENSITY, YOUNG)

        def made(mesh: HexMesh | FiniteCells) -> Solid:
            if isinstance(mesh, FiniteCells):
                return finite_cell_model(mesh, np.full(mesh.mesh.n_cells, YOUNG), regions)
            return fine_model(mesh, np.full(mesh.n_cells, YOUNG), regions=regions)

        self._unsolved = UnsolvedSolid(surface, name, how, made)
        key = hashlib.sha256(repr((__version__, _VERSION, how, poisson)).encode())
        if isinstance(surface, Wall):
            key.update(repr(surface.size).encode())
        triangles = surface.surface if isinstance(surface, Wall) else surface
        key.update(np.asarray(triangles.vertices, dtype="<f8").tobytes())
        key.update(np.asarray(triangles.faces, dtype="<i8").tobytes())
        self._key = key.hexdigest()

    @cached_property
    def _known(self) -> SolvedSolid | None:
        """The solid with its modes, if they were found before."""
        return kept_before(self._key) if self._unsolved.how.count else None

    @cached_property
    def rigid(self) -> MassProperties:
        """Mass, centre of mass and inertia."""
        return self._unsolved.rigid if self._known is None else self._known.rigid

    @cached_property
    def solved(self) -> SolvedSolid:
        """The solid with its modes; raises ConvergenceError if they were not found."""
        if self._known is not None:
            return self._known
        return kept(self._key, self._unsolved.solved)


def scaled(solid: SolvedSolid, size: float, young: float, density: float) -> SolvedSolid:
    """A uniform solid at another size, of another modulus [Pa] and density [kg/m^3]."""
    stiffer, denser = young / YOUNG, density / DENSITY
    model = resized(solid.model, size)
    model = model.with_young(np.full(model.mesh.n_cells, young))
    model = model.with_regions(solid.model.regions.scaled(denser, stiffer))
    return replace(
        solid,
        model=model,
        eigenvalues=solid.eigenvalues * (stiffer / denser / size**2),
        modes=solid.modes / np.sqrt(denser * size**3),
        rigid=scaled_rigid(solid.rigid, size, denser),
    )
