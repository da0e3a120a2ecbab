"""Modes of a solid of one material, computed once for all its sizes, moduli and densities.

A solid of the size s, Young's modulus E and density rho has the eigenvalues of that of size 1, E_0
and rho_0 times (E / E_0) (rho_0 / rho) / s^2, if Poisson's ratios agree; mass-normalised modes go
as 1 / sqrt(rho s^3).  The modes are kept in the user's cache.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace

import numpy as np

from carillon import __version__
from carillon.arrays import Surface
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.model import finite_cell_model
from carillon.fem.geometry import HexMesh
from carillon.fem.geometry.walls import Wall
from carillon.fem.model import Solid, fine_model
from carillon.fem.regions import Regions
from sound.scenes.solved import Discretised, SolvedSolid, discretised, kept, resized, with_modes

YOUNG, DENSITY = 1e9, 1000.0
"""Young's modulus [Pa] and density [kg/m^3] of the solid whose modes are computed."""
_VERSION = 1  # counted up when other modes are found than before


class UniformSolid(SolvedSolid):
    """A solid of one material: mesh, modulus and density."""

    def scaled(self, size: float, young: float = YOUNG, density: float = DENSITY) -> UniformSolid:
        """The same solid at another size, of another modulus [Pa] and density [kg/m^3]."""
        stiffer, denser = young / YOUNG, density / DENSITY
        model = resized(self.model, size)
        model = model.with_young(np.full(model.mesh.n_cells, young))
        model = model.with_regions(self.model.regions.scaled(denser, stiffer))
        if self.eigenvalues is None or self.modes is None:
            return replace(self, model=model)
        return UniformSolid(
            model,
            self.eigenvalues * (stiffer / denser / size**2),
            self.modes / np.sqrt(denser * size**3),
            self.accuracy,
        )

    def sized(
        self, size: float, young: float, density: float, pitch: float | None
    ) -> tuple[UniformSolid, float]:
        """The same solid at another size, and the factor that a pitch [Hz] enlarges it further by.

        The factor is 1 without a pitch.
        """
        solid = self.scaled(size, young, density)
        if pitch is None:
            return solid, 1.0
        factor = solid.factor_to(pitch)
        return self.scaled(factor * size, young, density), factor


def uniform_solid(
    surface: Surface | Wall, name: str, how: Discretised, poisson: float
) -> UniformSolid:
    """The solid of a surface, of `YOUNG`, `DENSITY` and a Poisson's ratio, and its modes.

    Raises UserError if the surface encloses nothing, walls too thin, or several pieces, and
    ConvergenceError if modes were not found.
    """
    regions = Regions.one(poisson, DENSITY, YOUNG)

    def made(mesh: HexMesh | FiniteCells) -> Solid:
        if isinstance(mesh, FiniteCells):
            return finite_cell_model(mesh, np.full(mesh.mesh.n_cells, YOUNG), regions)
        return fine_model(mesh, np.full(mesh.n_cells, YOUNG), regions=regions)

    if how.count == 0:
        return _uniform(discretised(surface, name, how, made))
    key = hashlib.sha256(repr((__version__, _VERSION, how, poisson)).encode())
    if isinstance(surface, Wall):
        key.update(repr(surface.size).encode())
    triangles = surface.surface if isinstance(surface, Wall) else surface
    key.update(np.asarray(triangles.vertices, dtype="<f8").tobytes())
    key.update(np.asarray(triangles.faces, dtype="<i8").tobytes())

    def solved() -> SolvedSolid:
        return with_modes(surface, name, how, made, discretised(surface, name, how, made))

    return _uniform(kept(key.hexdigest(), solved))


def _uniform(solid: SolvedSolid) -> UniformSolid:
    return UniformSolid(solid.model, solid.eigenvalues, solid.modes, solid.accuracy)
