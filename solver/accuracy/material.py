"""A material as a function of place, so that solids on any lattice have the same one."""

from dataclasses import dataclass
from itertools import product
from typing import Self

import numpy as np
from scipy.ndimage import distance_transform_edt, map_coordinates

from carillon.arrays import Array, Flags
from carillon.fem.geometry import HexMesh
from carillon.fem.geometry.grid import Grid

INTERPOLATED = ("uniform", "smooth")
"""Materials that vary gradually. In the others each voxel has a modulus of its own."""
ARITHMETIC, HARMONIC = 1.0, -1.0
"""Powers of the arithmetic and of the harmonic mean."""


@dataclass(frozen=True)
class PlacedMaterial:
    """Young's modulus at any place, from the voxels of a lattice."""

    lattice: Grid
    """Where the voxels are."""
    young: Array
    """(nx, ny, nz) their moduli [Pa]; a voxel outside the solid has that of the nearest inside."""
    filled: Flags
    """(nx, ny, nz) bool: which voxels are of the solid."""
    interpolated: bool
    """Whether log moduli are interpolated linearly between the middles of voxels; else a voxel's
    modulus is that of all places in it."""

    @classmethod
    def of_voxels(cls, lattice: Grid, mesh: HexMesh, young: Array, interpolated: bool) -> Self:
        """From moduli (m,) [Pa] of the voxels of a mesh on the lattice."""
        places = tuple(mesh.grid.T)
        filled, values = np.zeros(lattice.shape, dtype=bool), np.zeros(lattice.shape)
        filled[places], values[places] = True, young
        nearest = distance_transform_edt(~filled, return_distances=False, return_indices=True)
        return cls(lattice, values[tuple(nearest)], filled, interpolated)

    def on(self, mesh: HexMesh, power: float = ARITHMETIC) -> Array:
        """Moduli (m,) [Pa] of the voxels of another mesh, whose lattice nests with this one.

        They are those at the middles of the voxels or, of voxels that join several of this lattice
        with moduli of their own, the means over those that are of the solid (over all if none is):
        of `power` 1 arithmetic ones, which assume one strain in all, of -1 harmonic ones, which
        assume one stress (Voigt 1889, Reuss 1929).
        """
        corner = (mesh.origin - self.lattice.origin) / self.lattice.edge
        span = mesh.edge / self.lattice.edge
        middles = corner + span * (mesh.grid + 0.5)
        if self.interpolated:
            at = (middles - 0.5).T
            logs = map_coordinates(np.log(self.young), at, order=1, mode="nearest")
            return np.asarray(np.exp(logs))
        if span < 1.5:
            return np.asarray(self.young[tuple(np.floor(middles).astype(int).T)])
        first = np.rint(middles - 0.5 * span).astype(int)
        offsets = np.array(list(product(range(round(span)), repeat=3)))
        joined = tuple(np.moveaxis(first[:, None] + offsets, 2, 0))
        weights = self.filled[joined].astype(float)
        weights[~weights.any(axis=1)] = 1.0
        powers = self.young[joined] ** power
        means = (weights * powers).sum(axis=1) / weights.sum(axis=1)
        return np.asarray(means ** (1.0 / power))
