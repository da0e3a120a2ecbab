"""Solids of scenes that are of several regions, or held: their modes, and what they are made of.

Their modes are kept in the user's cache, too, but serve no other materials.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from carillon import __version__
from carillon.arrays import Array, Index
from carillon.composition.composition import Composition, PlacedRegions
from carillon.composition.entries import CompositionEntry, SolidFrame, compose
from carillon.composition.materials import NamedMaterial
from carillon.composition.supports import placed_supports
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.model import FiniteCellModel, finite_cell_model
from carillon.fem.geometry import HexMesh
from carillon.fem.model import Solid, fine_model
from carillon.fem.regions import Damping as Coefficients
from carillon.fem.regions import Regions
from solver.analysis.solid_surface import SolidSurface
from sound.scenes.object_entry import ObjectEntry
from sound.scenes.solved import Discretised, SolvedSolid, UnsolvedSolid, kept
from sound.scenes.touched import touched_material

INWARDS = 1e-5
"""Step from the surface at which it is asked what it is of, over the longest side."""
REST = "the rest"
"""Name of the region of an object's own material."""
_VERSION = 2  # counted up when other modes are found than before


class ComposedObject:
    """Regions, supports and solid of a scene's object, in metres and in axes whose z points up.

    Raises UserError for regions or supports that describe nothing.
    """

    def __init__(self, entry: ObjectEntry, given: SolidSurface) -> None:
        surface = given.triangles
        self._entry, self._surface, self._inside = entry, surface, given.solid
        rest = None
        if entry.material is not None:
            own = entry.made_of
            damping = own.alpha, own.beta
            names = {each.name for each in entry.regions}
            name = next(each for each in _names() if each not in names)
            rest = Regions.one(own.poisson, own.density, own.young, damping, name)
        described = CompositionEntry(regions=entry.regions, supports=entry.supports)
        assert entry.mesh is not None
        frame = SolidFrame(entry.mesh, surface, entry.name, entry.unit, up=given.up)
        placed = compose(described, frame, rest=rest)
        assert placed.composition is not None
        self.composition: Composition = placed.composition
        self._supports = placed.supports
        rows = {each.name: each.row() for each in entry.regions}
        first = () if rest is None else (entry.made_of,)
        by_name = {each.name: each for each in entry.regions}
        touched = [touched_material(entry, rows[name], by_name[name]) for name in rows]
        self.materials = (*first, *touched)
        """Materials as others touch them, in the order of the composition's parts."""
        self._coefficients = dict(
            zip([*([] if rest is None else rest.names), *rows], map(_coefficients, self.materials))
        )

    def unsolved(self, how: Discretised) -> UnsolvedSolid:
        """The solid, without modes yet."""
        return UnsolvedSolid(self._inside, self._entry.name, how, self._made, self._placed_on)

    def solved(self, unsolved: UnsolvedSolid) -> SolvedSolid:
        """The solid with its modes.

        Raises UserError if it cannot be made, and ConvergenceError if modes were not found.
        """
        model = unsolved.model
        key = hashlib.sha256(repr((__version__, _VERSION, unsolved.how)).encode())
        for part in _content(model):
            key.update(np.ascontiguousarray(part).tobytes())
        found = kept(key.hexdigest(), unsolved.solved)
        if model.region is None:  # files do not name the region if there is one
            return replace(found, model=found.model.with_regions(model.regions))
        return replace(found, model=losing(found.model, self._coefficients))

    def _placed_on(self, cells: FiniteCells) -> PlacedRegions:
        placed = self.composition.of_cells(cells, complete=False)
        names = placed.regions.names
        damping = tuple(self._coefficients[name] for name in names)
        return replace(placed, regions=replace(placed.regions, damping=damping))

    def _made(self, mesh: HexMesh | FiniteCells) -> Solid:
        model: Solid
        if isinstance(mesh, FiniteCells):
            placed = self.composition.of_cells(mesh)
            young = _moduli(placed, mesh.mesh)
            model = finite_cell_model(mesh, young, placed.regions, placed.region, placed.shared)
        else:
            placed = self.composition.of_voxels(mesh)
            young = _moduli(placed, mesh)
            model = fine_model(mesh, young, placed.region, regions=placed.regions)
        supports = placed_supports(self._supports, model, self._surface, self._entry.name)
        model = losing(model, self._coefficients)
        return model if supports is None else model.with_supports(supports)

    def parts_of(self, vertices: Array, faces: Index) -> Index:
        """Part (V,) of the composition that the vertices (V, 3) [m] of the surface are of."""
        import trimesh

        from solver.response.vertices import inward_normals

        surface = trimesh.Trimesh(vertices, faces, process=False)
        step = INWARDS * float(np.max(surface.extents))
        return self.composition.parts_at(vertices + step * inward_normals(surface, vertices))


def _names() -> Sequence[str]:
    return [REST, *(f"{REST} {number}" for number in range(2, 1002))]


def _coefficients(material: NamedMaterial) -> Coefficients:
    return material.alpha, material.beta


def losing(model: Solid, by_name: Mapping[str, Coefficients]) -> Solid:
    """A solid whose regions have these dampings, by name."""
    regions = model.regions
    damping = tuple(by_name[name] for name in regions.names)
    return model.with_regions(replace(regions, damping=damping))


def _moduli(placed: PlacedRegions, mesh: HexMesh) -> Array:
    return placed.regions.moduli(placed.region, np.ones(mesh.n_cells))


def _content(model: Solid) -> list[Array]:
    """All that the modes of a solid depend on."""
    mesh, regions = model.mesh, model.regions
    parts = [mesh.origin, np.array([mesh.edge]), mesh.grid, model.young]
    parts += [regions.elasticity, regions.density, regions.young]
    if model.region is not None:
        parts.append(model.region)
    if isinstance(model, FiniteCellModel):
        cells = model.cells
        parts += [cells.nodes, cells.cell, cells.place, cells.row, cells.weights]
        if model.shared is not None:
            shared = model.shared
            parts += [shared.portion, shared.region, shared.weights]
    if model.supports is not None:
        held = model.supports
        parts += [held.positions, held.stiffness, held.mass]
    return parts
