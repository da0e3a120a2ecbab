"""What solids of scenes are made of where others touch them."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from carillon.arrays import Array, Index, Integers
from carillon.composition.entries import RegionEntry
from carillon.composition.materials import NamedMaterial, named_material
from carillon.errors import UserError
from carillon.fem.finite_cells.model import FiniteCellModel
from carillon.fem.geometry import CORNER_OFFSETS
from carillon.fem.model import ElasticModel, Solid
from carillon.fem.regions import Regions
from sound.scenes.object_entry import ObjectEntry


def touched_material(entry: ObjectEntry, row: Regions, region: RegionEntry) -> NamedMaterial:
    """A region of an object as others touch it.

    Moduli of wood are those of an isotropic mixture of all directions. What the object itself says
    of friction, bounce, roughness, colour and damping counts for all of it.
    """
    named = entry.made_of if region.material is None else named_material(region.material)
    share, poisson = row.laws[0].isotropic_equivalent()
    alpha, beta = row.damping[0] or (entry.made_of.alpha, entry.made_of.beta)
    touched = replace(
        entry.as_told(named),
        young=share * float(row.young[0]),
        poisson=poisson,
        density=float(row.density[0]),
    )
    if entry.damping is None:
        touched = replace(touched, alpha=alpha, beta=beta)
    return touched


class Touched(NamedTuple):
    """What the surface of a solid in a file is of: shares of its moduli that count where it is
    touched, Poisson's ratios, materials, and which of them each vertex is of.
    """

    share: Array | float
    poisson: Array | float
    materials: tuple[NamedMaterial, ...]
    which: Integers | None


def touched_in_file(entry: ObjectEntry, path: str, model: Solid, vertices: Array) -> Touched:
    """What the surface of a file's solid is of at its vertices (V, 3) [m].

    Raises UserError if the object names a region that the file does not have.
    """
    regions, named = model.regions, {each.name: each for each in entry.regions}
    names = tuple(dict.fromkeys(regions.names))
    for name in named:
        if name not in names:
            raise UserError(f"{path}: has no region {name!r}; it has {', '.join(map(repr, names))}")
    equivalent = np.array([law.isotropic_equivalent() for law in regions.laws])
    if model.region is None:
        material = entry.made_of
        if names[0] in named:
            material = touched_material(entry, regions, named[names[0]])
        return Touched(float(equivalent[0, 0]), regions.mean_poisson, (material,), None)
    rows = regions_near(model, vertices)
    materials = tuple(
        touched_material(
            entry,
            regions.rows(np.array([regions.names.index(name)])),
            named.get(name, RegionEntry(name=name)),
        )
        for name in names
    )
    number = np.array([names.index(name) for name in regions.names])
    share, poisson = equivalent[rows].T
    return Touched(share, poisson, materials, number[rows])


def regions_near(model: Solid, points: Array) -> Index:
    """Row (p,) of the table of regions of the voxels or octants nearest to points (p, 3) [m]."""
    if model.region is None:
        return np.zeros(len(points), dtype=np.int64)
    middles, region = _middles(model)
    return np.asarray(region[_nearest(middles, points)], dtype=np.int64)


def young_near(model: Solid, points: Array) -> Array:
    """Young's modulus (p,) [Pa] of the voxels nearest to points (p, 3) [m]."""
    middles = model.mesh.nodes[model.mesh.cells].mean(axis=1)
    moduli = model.young.reshape(len(model.young), -1).mean(axis=1)
    return np.asarray(moduli[_nearest(middles, points)])


def _middles(model: Solid) -> tuple[Array, Index]:
    """Middles (m, 3) [m] of what has a region, and the regions (m,)."""
    mesh = model.mesh
    assert model.region is not None
    span = np.ones((mesh.n_cells, 1)) if mesh.span is None else mesh.span[:, None].astype(float)
    if isinstance(model, FiniteCellModel):
        middles = mesh.origin + mesh.edge * (mesh.grid + 0.5 * span)
        return middles, np.asarray(model.region, dtype=np.int64)
    assert isinstance(model, ElasticModel)
    offsets = 0.25 + 0.5 * CORNER_OFFSETS
    octants = mesh.grid[:, None] + span[:, None] * offsets
    chosen = model.filled
    return mesh.origin + mesh.edge * octants[chosen], model.region[chosen].astype(np.int64)


def _nearest(middles: Array, points: Array) -> Index:
    from scipy.spatial import cKDTree  # Its import takes long.

    return np.asarray(cKDTree(middles).query(points)[1])
