"""Solids of scenes and their modes, which are kept in the user's cache."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from carillon.arrays import Array, Surface
from carillon.command_line.progress import say
from carillon.composition.composition import PlacedRegions
from carillon.errors import UserError
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.model import FiniteCellModel
from carillon.fem.geometry import HexMesh, hexmesh_from_voxels, voxelize
from carillon.fem.geometry.bridges import say_bridged
from carillon.fem.geometry.walls import Wall
from carillon.fem.model import RIGID_MODES, ElasticModel, MassProperties, Solid, mass_properties
from carillon.files.cache import recalled, remembered
from carillon.processes.threads import one_thread
from solver.accuracy.divide import DividedCells, solve_refined
from solver.accuracy.voxels import Reference, covering_on, voxel_lattice
from solver.analysis.options import SolverOptions
from solver.analysis.problem import AUTO, WALL_OF_VOXELS
from solver.files.modes_file import read_modes, write_modes
from solver.refinement.errors import (
    DIVIDED_CELLS,
    FROM_SOLID,
    LAST,
    RefinementStep,
)
from solver.refinement.model_solver import SolveByOptions
from solver.response.response import Damping
from sound.rendering.solid import SoundingSolid

if TYPE_CHECKING:  # Its import takes long.
    from carillon.fem.finite_cells.covering import Covering

VOXEL, FINITE_CELL = "voxel", "finite-cell"
DISCRETISATIONS = (AUTO, FINITE_CELL, VOXEL)
"""Methods of discretisation; `auto` takes finite cells, or voxels if these refuse a surface."""

FEWEST = RIGID_MODES + 1
"""Fewest modes that the solver is asked for."""

Made = Callable[[HexMesh | FiniteCells], Solid]
"""Solid of voxels or of finite cells, with its material and what holds it."""

Placed = Callable[[FiniteCells], PlacedRegions]
"""Regions of a solid as other finite cells of it have them."""


@dataclass(frozen=True)
class Discretised:
    """Discretisation of a solid, one of `DISCRETISATIONS`, with `resolution` lattice spacings along
    the longest side.

    `components` are the pieces that are kept, see `carillon.fem.geometry.voxelize`; `count` is the
    number of elastic modes, 0 for the solid alone. Finite cells are divided until the expected
    error of the frequencies is at most `accuracy`; None divides none.
    """

    discretisation: str
    resolution: int
    components: str
    count: int
    accuracy: float | None = None


@dataclass(frozen=True)
class SolvedSolid:
    """A solid and its modes.

    `eigenvalues` (k,) [rad^2/s^2] and `modes` (n_dofs, k) [kg^-1/2] ascend, the rigid ones first.
    `rigid` is the solid as a rigid body, by the cells before any were divided.  `accuracy` tells
    discretisation, resolution, and expected errors of the frequencies as in
    `solver.refinement.errors.ExpectedErrors.attributes`, if they could be estimated.
    """

    model: Solid
    eigenvalues: Array
    modes: Array
    rigid: MassProperties
    accuracy: dict[str, Any]

    def resized(self, size: float) -> Self:
        """The same solid enlarged, of the same material.

        What holds it fast does so still; springs and masses would have to change with it.
        """
        return replace(
            self,
            model=resized(self.model, size),
            eigenvalues=self.eigenvalues / size**2,
            modes=self.modes / np.sqrt(size**3),
            rigid=scaled_rigid(self.rigid, size),
        )

    def factor_to(self, pitch: float) -> float:
        """Factor that gives the first elastic mode the frequency `pitch` [Hz], as frequencies go as
        1 / size.
        """
        first = float(np.sqrt(self.eigenvalues[self.model.rigid_modes]))
        return first / (2.0 * np.pi * pitch)

    def sounding(self, damping: Damping | None = None) -> SoundingSolid:
        """The solid with its modes, damped, or as its regions are if None."""
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


def scaled_rigid(rigid: MassProperties, size: float, denser: float = 1.0) -> MassProperties:
    """A rigid body enlarged about the origin, of a density that is `denser` times as large."""
    heavier = denser * size**3
    return replace(
        rigid,
        mass=heavier * rigid.mass,
        centre=size * rigid.centre,
        moments=heavier * size**2 * rigid.moments,
    )


class UnsolvedSolid:
    """The solid inside a surface, or its wall: discretised when it is needed, and solved later.

    `made` gives the discretisation its material, and `placed_on` its regions to finite cells that
    are divided; None if it has one region.
    """

    def __init__(
        self,
        surface: Surface | Wall,
        name: str,
        how: Discretised,
        made: Made,
        placed_on: Placed | None = None,
    ) -> None:
        self.name, self.how = name, how
        self._surface, self._made, self._placed_on = surface, made, placed_on

    @property
    def model(self) -> Solid:
        """The solid, of voxels or of undivided finite cells.

        Raises UserError if the surface encloses nothing, walls too thin, or several pieces.
        """
        return self._discretised[0]

    @cached_property
    def rigid(self) -> MassProperties:
        """Mass, centre of mass and inertia; raises the errors of `model`."""
        return mass_properties(self.model)

    @cached_property
    def _discretised(self) -> tuple[Solid, Covering | None]:
        """The model, and the covering by finite cells that it is of, if it is of these."""
        chosen = self.how.discretisation
        try:
            return self._model_of(FINITE_CELL if chosen == AUTO else chosen)
        except UserError as error:
            if chosen == VOXEL:
                hint = "finite cells (discretisation: auto) take walls thinner than a voxel"
                raise UserError(f"{error}; {hint}") from None
            if chosen == FINITE_CELL or isinstance(self._surface, Wall):
                raise
            try:
                found = self._model_of(VOXEL)
            except UserError:
                raise error from None
            say(f"voxels are taken in place of finite cells: {error}")
            return found

    def _model_of(self, discretisation: str) -> tuple[Solid, Covering | None]:
        surface, how = self._surface, self.how
        if discretisation == FINITE_CELL:
            from carillon.fem.finite_cells.build import covering  # Its import takes long.

            cover = covering(surface, how.resolution, how.components, self.name)
            return self._made(cover.cells), cover
        if isinstance(surface, Wall):
            raise UserError(WALL_OF_VOXELS)
        voxels = voxelize(surface, how.resolution, components=how.components, name=self.name)
        say_bridged(surface, voxels)
        return self._made(hexmesh_from_voxels(voxels)), None

    def solved(self) -> SolvedSolid:
        """The solid with `how.count` elastic modes.

        Raises ConvergenceError if modes were not found, and the errors of `model`.
        """
        model, covering = self._discretised
        count = model.rigid_modes + self.how.count
        accuracy: dict[str, Any] = {
            "discretisation": VOXEL if covering is None else FINITE_CELL,
            "resolution": self.how.resolution,
        }
        solve = SolveByOptions(SolverOptions(modes=max(count, FEWEST)))
        say(f"finding {self.how.count} modes of {self.name!r}: {model.n_dofs:,} unknowns")
        with one_thread():
            if covering is None:
                result = solve(model)
                accuracy |= self._distance_of_voxels(model, result.values[:count], solve)
            else:
                assert isinstance(model, FiniteCellModel)
                cells = DividedCells(covering, model, self._placed_on)
                tolerance = self.how.accuracy or np.inf
                finer, result, steps = solve_refined(solve, cells, tolerance, report=self._report)
                assert finer is not None
                model = finer
                accuracy |= _achieved(steps, tolerance)
            modes = result.system.gather(result.vectors)
            result.destroy()
        assert modes is not None
        return SolvedSolid(model, result.values[:count], modes[:, :count], self.rigid, accuracy)

    def _report(self, step: RefinementStep) -> None:
        say(
            f"{self.name!r}: {step.unknowns:,} unknowns, {step.refined:,} cells divided, "
            f"frequencies are expected to be {step.errors.rms:.1%} off",
            visible=sys.stderr.isatty(),
        )

    def _distance_of_voxels(
        self, model: Solid, values: Array, solve: SolveByOptions
    ) -> dict[str, Any]:
        """Expected errors of the frequencies of voxels, by finite cells on their lattice."""
        assert not isinstance(self._surface, Wall)
        try:
            lattice = voxel_lattice(self._surface, self.how.resolution)
            cells = self._made(covering_on(self._surface, lattice, "largest", self.name).cells)
            assert isinstance(cells, FiniteCellModel)
            result = solve(cells, min(cells.rigid_modes + self.how.count, LAST))
            modes = result.system.gather(result.vectors)
            result.destroy()
            assert modes is not None
            errors = Reference(cells).errors(values, result.values, modes)
        except Exception as error:  # the modes are right without it
            say(
                f"how far the frequencies of {self.name!r} are from the solid's cannot be told: "
                f"{error}"
            )
            return {}
        return errors.attributes(FROM_SOLID)


def _achieved(steps: list[RefinementStep], tolerance: float) -> dict[str, Any]:
    if not steps:
        return {}
    last = steps[-1]
    achieved = last.errors.attributes(FROM_SOLID) | {DIVIDED_CELLS: last.refined}
    if last.errors.excess(tolerance) > 1.0:
        achieved["missed_accuracy"] = tolerance
    return achieved


def kept(key: str, made: Callable[[], SolvedSolid]) -> SolvedSolid:
    """A solid with its modes, which is made unless the user's cache has it."""
    return remembered("modes", key, made, _read, _write)


def kept_before(key: str) -> SolvedSolid | None:
    """A solid with its modes, if the user's cache has it."""
    return recalled("modes", key, _read)


def _read(path: Path) -> SolvedSolid:
    file = read_modes(path)
    accuracy, rigid = (file.attributes.get(key) for key in ("accuracy", "rigid"))
    if not isinstance(accuracy, dict) or not isinstance(rigid, dict) or file.modes is None:
        raise UserError(f"{path}: is incomplete, it does not say how accurate it is")
    body = MassProperties(
        float(rigid["mass"]), *(np.array(rigid[key]) for key in ("centre", "moments", "axes"))
    )
    return SolvedSolid(file.model, file.eigenvalues, file.modes, body, accuracy)


def _write(path: Path, solid: SolvedSolid) -> None:
    rigid = {key: np.asarray(value).tolist() for key, value in asdict(solid.rigid).items()}
    attributes = {"accuracy": solid.accuracy, "rigid": rigid}
    none = np.zeros(len(solid.eigenvalues))
    write_modes(path, solid.model, solid.eigenvalues, [solid.modes], none, attributes, {})
