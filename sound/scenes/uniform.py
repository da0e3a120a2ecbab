"""Modes of a solid of one material, computed once for all its sizes, moduli and densities.

A solid of the size s, Young's modulus E and density rho has the eigenvalues of that of size 1, E_0
and rho_0 times (E / E_0) (rho_0 / rho) / s^2, if Poisson's ratios agree; mass-normalised modes go
as 1 / sqrt(rho s^3).  The modes are kept in the user's cache.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from carillon import __version__
from carillon.arrays import Array, Surface
from carillon.command_line.progress import say
from carillon.errors import UserError
from carillon.fem.finite_cells.model import FiniteCellModel, finite_cell_model
from carillon.fem.geometry import hexmesh_from_voxels, voxelize
from carillon.fem.geometry.bridges import say_bridged
from carillon.fem.model import RIGID_MODES, ElasticModel, Solid, fine_model
from carillon.fem.regions import Regions
from carillon.files.cache import remembered
from carillon.processes.threads import one_thread
from solver.accuracy.estimate import estimate_cell_errors
from solver.accuracy.voxels import Reference, covering_on, voxel_lattice
from solver.analysis.problem import AUTO
from solver.files.modes_file import read_modes, write_modes
from solver.refinement.errors import FROM_SOLID, LAST, ExpectedErrors
from solver.response.response import Damping
from sound.rendering.solid import SoundingSolid

YOUNG, DENSITY = 1e9, 1000.0
"""Young's modulus [Pa] and density [kg/m^3] of the solid whose modes are computed."""
VOXEL, FINITE_CELL = "voxel", "finite-cell"
DISCRETISATIONS = (AUTO, FINITE_CELL, VOXEL)
"""Methods of discretisation; `auto` takes finite cells, or voxels if these refuse a surface."""
_KIND, _VERSION = "modes of scenes", 1  # counted up, too, when other modes are found than before


@dataclass(frozen=True)
class Discretised:
    """Discretisation of a solid, one of `DISCRETISATIONS`, with `resolution` lattice spacings along
    the longest side.

    `components` are the pieces that are kept, see `carillon.fem.geometry.voxelize`; `count` is the
    number of elastic modes, 0 for the solid alone.
    """

    discretisation: str
    resolution: int
    components: str
    poisson: float
    count: int


@dataclass(frozen=True)
class UniformSolid:
    """A solid of one material: mesh, modulus and density.

    `eigenvalues` (k,) [rad^2/s^2] and `modes` (n_dofs, k) [kg^-1/2] ascend, the six rigid ones
    first; they are None if none were requested.  `accuracy` tells discretisation, resolution, and
    expected errors of the frequencies as in `solver.refinement.errors.ExpectedErrors.attributes`,
    if they could be estimated.
    """

    model: Solid
    eigenvalues: Array | None
    modes: Array | None
    accuracy: dict[str, Any]

    def scaled(self, size: float, young: float = YOUNG, density: float = DENSITY) -> UniformSolid:
        """The same solid at another size, of another modulus [Pa] and density [kg/m^3]."""
        stiffer, denser = young / YOUNG, density / DENSITY
        model = _resized(self.model, size)
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
        """The same solid at another size, and the factor that a pitch enlarges it further by.

        The factor gives the first elastic mode the frequency `pitch` [Hz], as frequencies go as
        1 / size; it is 1 without a pitch.
        """
        solid = self.scaled(size, young, density)
        if pitch is None:
            return solid, 1.0
        assert solid.eigenvalues is not None
        factor = float(np.sqrt(solid.eigenvalues[RIGID_MODES])) / (2.0 * np.pi * pitch)
        return self.scaled(factor * size, young, density), factor

    def sounding(self, damping: Damping) -> SoundingSolid | None:
        """The solid with its modes, damped; None without modes."""
        if self.eigenvalues is None or self.modes is None:
            return None
        return SoundingSolid.damped(self.model, self.eigenvalues, self.modes, damping)


def uniform_solid(surface: Surface, name: str, how: Discretised) -> UniformSolid:
    """The solid inside a surface, of `YOUNG` and `DENSITY`, and its modes.

    Raises UserError if the surface encloses nothing, walls too thin, or several pieces, and
    ConvergenceError if modes were not found.
    """
    if how.count == 0:
        return _without_modes(surface, name, how)
    key = hashlib.sha256(repr((__version__, _VERSION, how)).encode())
    key.update(np.asarray(surface.vertices, dtype="<f8").tobytes())
    key.update(np.asarray(surface.faces, dtype="<i8").tobytes())
    return remembered("modes", key.hexdigest(), lambda: _solved(surface, name, how), _read, _write)


def _solved(surface: Surface, name: str, how: Discretised) -> UniformSolid:
    from solver.analysis.library import solve

    solid = _without_modes(surface, name, how)
    with one_thread():
        result = solve(solid.model, modes=RIGID_MODES + how.count)
        assert result.modes is not None
        accuracy = {**solid.accuracy}
        try:
            errors = _expected(surface, name, how, solid.model, result.eigenvalues, result.modes)
            accuracy |= errors.attributes(FROM_SOLID)
        except Exception as error:  # the modes are right without it
            say(f"how far the frequencies of {name!r} are from the solid's cannot be told: {error}")
    return UniformSolid(solid.model, result.eigenvalues, result.modes, accuracy)


def _without_modes(surface: Surface, name: str, how: Discretised) -> UniformSolid:
    chosen = FINITE_CELL if how.discretisation == AUTO else how.discretisation
    try:
        model = _model(surface, name, how, chosen)
    except UserError as error:
        if how.discretisation == VOXEL:
            hint = "finite cells (discretisation: auto) take walls thinner than a voxel"
            raise UserError(f"{error}; {hint}") from None
        if how.discretisation == FINITE_CELL:
            raise
        chosen = VOXEL
        try:
            model = _model(surface, name, how, chosen)
        except UserError:
            raise error from None
        say(f"voxels are taken in place of finite cells: {error}")
    return UniformSolid(model, None, None, {"discretisation": chosen, "resolution": how.resolution})


def _model(surface: Surface, name: str, how: Discretised, discretisation: str) -> Solid:
    if discretisation == FINITE_CELL:
        from carillon.fem.finite_cells.build import finite_cells  # Its import takes long.

        cells = finite_cells(surface, how.resolution, how.components, name)
        young = np.full(cells.mesh.n_cells, YOUNG)
        return finite_cell_model(cells, young, Regions.one(how.poisson, DENSITY, YOUNG))
    voxels = voxelize(surface, how.resolution, components=how.components, name=name)
    say_bridged(surface, voxels)
    mesh = hexmesh_from_voxels(voxels)
    young = np.full(mesh.n_cells, YOUNG)
    return fine_model(mesh, young, regions=Regions.one(how.poisson, DENSITY, YOUNG))


def _expected(
    surface: Surface,
    name: str,
    how: Discretised,
    model: Solid,
    values: Array,
    modes: Array,
) -> ExpectedErrors:
    """Expected errors of frequencies; those of voxels by finite cells on their lattice."""
    if isinstance(model, FiniteCellModel):
        return estimate_cell_errors(model, values, modes).errors
    from solver.analysis.library import solve

    lattice = voxel_lattice(surface, how.resolution)
    cells = covering_on(surface, lattice, "largest", name).cells
    young = np.full(cells.mesh.n_cells, YOUNG)
    regions = Regions.one(how.poisson, DENSITY, YOUNG)
    reference = Reference(finite_cell_model(cells, young, regions))
    result = solve(reference.model, modes=min(RIGID_MODES + how.count, LAST))
    assert result.modes is not None
    return reference.errors(values, result.eigenvalues, result.modes)


def _resized(model: Solid, size: float) -> Solid:
    def resized(mesh: Any) -> Any:
        return replace(mesh, origin=size * mesh.origin, edge=size * mesh.edge)

    if isinstance(model, FiniteCellModel):
        return replace(model, cells=replace(model.cells, mesh=resized(model.cells.mesh)))
    assert isinstance(model, ElasticModel)
    return replace(model, mesh=resized(model.mesh))


def _read(path: Path) -> UniformSolid:
    file = read_modes(path)
    accuracy = file.attributes.get("accuracy")
    if not isinstance(accuracy, dict):
        raise UserError(f"{path}: is incomplete, it does not say how accurate it is")
    return UniformSolid(file.model, file.eigenvalues, file.modes, accuracy)


def _write(path: Path, solid: UniformSolid) -> None:
    assert solid.eigenvalues is not None and solid.modes is not None
    attributes = {"accuracy": solid.accuracy}
    none = np.zeros(len(solid.eigenvalues))
    write_modes(path, solid.model, solid.eigenvalues, [solid.modes], none, attributes, {})
