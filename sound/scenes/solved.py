"""Solids of scenes and their modes, which are kept in the user's cache."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from carillon.arrays import Array, Surface
from carillon.command_line.progress import say
from carillon.errors import UserError
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.model import FiniteCellModel
from carillon.fem.geometry import HexMesh, hexmesh_from_voxels, voxelize
from carillon.fem.geometry.bridges import say_bridged
from carillon.fem.geometry.walls import Wall
from carillon.fem.model import RIGID_MODES, ElasticModel, Solid
from carillon.files.cache import remembered
from carillon.processes.threads import one_thread
from solver.accuracy.estimate import estimate_cell_errors
from solver.accuracy.voxels import Reference, covering_on, voxel_lattice
from solver.analysis.problem import AUTO, WALL_OF_VOXELS
from solver.files.modes_file import read_modes, write_modes
from solver.refinement.errors import FROM_SOLID, LAST, ExpectedErrors
from solver.response.response import Damping
from sound.rendering.solid import SoundingSolid

VOXEL, FINITE_CELL = "voxel", "finite-cell"
DISCRETISATIONS = (AUTO, FINITE_CELL, VOXEL)
"""Methods of discretisation; `auto` takes finite cells, or voxels if these refuse a surface."""

FEWEST = RIGID_MODES + 1
"""Fewest modes that the solver is asked for."""

Made = Callable[[HexMesh | FiniteCells], Solid]
"""Solid of voxels or of finite cells, with its material and what holds it."""


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
    count: int


@dataclass(frozen=True)
class SolvedSolid:
    """A solid and its modes.

    `eigenvalues` (k,) [rad^2/s^2] and `modes` (n_dofs, k) [kg^-1/2] ascend, the rigid ones first;
    they are None if none were requested.  `accuracy` tells discretisation, resolution, and
    expected errors of the frequencies as in `solver.refinement.errors.ExpectedErrors.attributes`,
    if they could be estimated.
    """

    model: Solid
    eigenvalues: Array | None
    modes: Array | None
    accuracy: dict[str, Any]

    def resized(self, size: float) -> Self:
        """The same solid enlarged, of the same material.

        What holds it fast does so still; springs and masses would have to change with it.
        """
        model = resized(self.model, size)
        if self.eigenvalues is None or self.modes is None:
            return replace(self, model=model)
        return replace(
            self,
            model=model,
            eigenvalues=self.eigenvalues / size**2,
            modes=self.modes / np.sqrt(size**3),
        )

    def factor_to(self, pitch: float) -> float:
        """Factor that gives the first elastic mode the frequency `pitch` [Hz], as frequencies go as
        1 / size.
        """
        assert self.eigenvalues is not None
        first = float(np.sqrt(self.eigenvalues[self.model.rigid_modes]))
        return first / (2.0 * np.pi * pitch)

    def sounding(self, damping: Damping | None = None) -> SoundingSolid | None:
        """The solid with its modes, damped, or as its regions are if None; None without modes."""
        if self.eigenvalues is None or self.modes is None:
            return None
        return SoundingSolid.damped(self.model, self.eigenvalues, self.modes, damping)


def resized(model: Solid, size: float) -> Solid:
    """A solid enlarged about the origin, and held in the same places."""

    def larger(mesh: Any) -> Any:
        return replace(mesh, origin=size * mesh.origin, edge=size * mesh.edge)

    supports = model.supports
    if supports is not None:
        places, stiffness = size * supports.positions, size * supports.stiffness
        supports = replace(supports, positions=places, stiffness=stiffness)
    if isinstance(model, FiniteCellModel):
        whole = model.cells
        cells = replace(whole, step=size * whole.step, mesh=larger(whole.mesh))
        return replace(model, cells=cells, supports=supports)
    assert isinstance(model, ElasticModel)
    return replace(model, mesh=larger(model.mesh), supports=supports)


def discretised(surface: Surface | Wall, name: str, how: Discretised, made: Made) -> SolvedSolid:
    """The solid inside a surface, or its wall, without modes.

    Raises UserError if the surface encloses nothing, walls too thin, or several pieces.
    """
    chosen = FINITE_CELL if how.discretisation == AUTO else how.discretisation
    try:
        model = made(_meshed(surface, name, how, chosen))
    except UserError as error:
        if how.discretisation == VOXEL:
            hint = "finite cells (discretisation: auto) take walls thinner than a voxel"
            raise UserError(f"{error}; {hint}") from None
        if how.discretisation == FINITE_CELL or isinstance(surface, Wall):
            raise
        chosen = VOXEL
        try:
            model = made(_meshed(surface, name, how, chosen))
        except UserError:
            raise error from None
        say(f"voxels are taken in place of finite cells: {error}")
    return SolvedSolid(model, None, None, {"discretisation": chosen, "resolution": how.resolution})


def _meshed(
    surface: Surface | Wall, name: str, how: Discretised, discretisation: str
) -> HexMesh | FiniteCells:
    if discretisation == FINITE_CELL:
        from carillon.fem.finite_cells.build import finite_cells  # Its import takes long.

        return finite_cells(surface, how.resolution, how.components, name)
    if isinstance(surface, Wall):
        raise UserError(WALL_OF_VOXELS)
    voxels = voxelize(surface, how.resolution, components=how.components, name=name)
    say_bridged(surface, voxels)
    return hexmesh_from_voxels(voxels)


def with_modes(
    surface: Surface | Wall, name: str, how: Discretised, made: Made, solid: SolvedSolid
) -> SolvedSolid:
    """A discretised solid with `how.count` elastic modes.

    Raises ConvergenceError if modes were not found.
    """
    from solver.analysis.library import solve

    model = solid.model
    with one_thread():
        count = model.rigid_modes + how.count
        result = solve(model, modes=max(count, FEWEST))
        assert result.modes is not None
        values, modes = result.eigenvalues[:count], result.modes[:, :count]
        accuracy = {**solid.accuracy}
        try:
            errors = _expected(surface, name, how, made, model, values, modes)
            accuracy |= errors.attributes(FROM_SOLID)
        except Exception as error:  # the modes are right without it
            say(f"how far the frequencies of {name!r} are from the solid's cannot be told: {error}")
    return SolvedSolid(model, values, modes, accuracy)


def _expected(
    surface: Surface | Wall,
    name: str,
    how: Discretised,
    made: Made,
    model: Solid,
    values: Array,
    modes: Array,
) -> ExpectedErrors:
    """Expected errors of frequencies; those of voxels by finite cells on their lattice."""
    if isinstance(model, FiniteCellModel):
        return estimate_cell_errors(model, values, modes).errors
    assert not isinstance(surface, Wall)
    from solver.analysis.library import solve

    lattice = voxel_lattice(surface, how.resolution)
    cells = made(covering_on(surface, lattice, "largest", name).cells)
    assert isinstance(cells, FiniteCellModel)
    reference = Reference(cells)
    result = solve(cells, modes=max(min(cells.rigid_modes + how.count, LAST), FEWEST))
    assert result.modes is not None
    return reference.errors(values, result.eigenvalues, result.modes)


def kept(key: str, made: Callable[[], SolvedSolid]) -> SolvedSolid:
    """A solid with its modes, which is made unless the user's cache has it."""
    return remembered("modes", key, made, _read, _write)


def _read(path: Path) -> SolvedSolid:
    file = read_modes(path)
    accuracy = file.attributes.get("accuracy")
    if not isinstance(accuracy, dict):
        raise UserError(f"{path}: is incomplete, it does not say how accurate it is")
    return SolvedSolid(file.model, file.eigenvalues, file.modes, accuracy)


def _write(path: Path, solid: SolvedSolid) -> None:
    assert solid.eigenvalues is not None and solid.modes is not None
    attributes = {"accuracy": solid.accuracy}
    none = np.zeros(len(solid.eigenvalues))
    write_modes(path, solid.model, solid.eigenvalues, [solid.modes], none, attributes, {})
