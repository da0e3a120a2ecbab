"""Where the eigenvalues of a solid are expected: Weyl's law, for bulky and for thin solids.

Those so close that their modes may be mixed are one cluster: only the space they span is certain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from carillon.fem.model import ElasticModel, Solid

NEIGHBOURHOOD = 2.0
"""Edge of the regions that vibrate as one material, in edges of a mode's share of the solid."""
SPHERE = 36.0 * np.pi
"""Surface of a sphere to the third power, over its volume squared: no solid has less."""
WEYL_EXPONENT = 2.0 / 3.0
"""Exponent by which the eigenvalues of a compact body grow with their number."""
CLUSTER_GAP = 1e-3
"""Largest relative distance of neighbours in a cluster of eigenvalues."""


@dataclass(frozen=True)
class CountingLaw:
    """About how many eigenvalues omega^2 lie below a value: the sum of `terms` omega^3, ^2 and ^1.

    The terms are of bulk waves [s^3], and of the in-plane [s^2] and flexural [s] waves of walls.
    """

    terms: tuple[float, float, float]

    @classmethod
    def of_solid(cls, solid: Solid, young: Array, number: int) -> CountingLaw:
        """Weyl's law, and that of a plate which has the volume and the surface of the solid.

        Without the plate a thin wall would have far too few modes.  A wave meets the geometric mean
        of the moduli about it; regions of different material count one by one.

        Parameters
        ----------
        young
            (m,) or (m, 8) moduli [Pa] of the cells of `solid.mesh`.
        number
            Of the eigenvalue of interest, which says how large regions are.
        """
        mesh = solid.mesh
        volume = solid.mass / solid.density
        # Inside there is a node to every cell, on the surface one more to every two faces.  Cells
        # that the surface cuts stand out from it.
        exposed = 2.0 * (mesh.n_nodes / mesh.n_cells - 1.0) * volume / mesh.edge
        surface = max(exposed, (SPHERE * volume**2) ** (1.0 / 3.0))
        size = NEIGHBOURHOOD * (mesh.n_cells / number) ** (1.0 / 3.0)
        if young.ndim == 2:
            assert isinstance(solid, ElasticModel)
            # Of a cell that is partly void modulus and mass are less.
            young = young.mean(axis=1) / solid.filled.mean(axis=1)
        poisson = solid.poisson
        if poisson is None or len(solid.regions) > 1:
            factor, poisson = _equivalent(solid)
            young = young * factor
        modulus, share = _regions(mesh.grid, young, size)
        # Slowness squared [s^2/m^2] of a wave of unit stiffness.
        slow = solid.density / modulus
        shear = 0.5 / (1.0 + poisson)
        pressure = (1.0 - poisson) / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
        plate = 1.0 / (1.0 - poisson**2)
        bulk = volume / (6.0 * np.pi**2) * (pressure**-1.5 + 2.0 * shear**-1.5)
        membrane = surface / (16.0 * np.pi) * (1.0 / plate + 1.0 / shear)
        flexure = surface**2 / (16.0 * np.pi * volume) * np.sqrt(12.0 / plate)
        means = (float(share @ slow**power) for power in (1.5, 1.0, 0.5))
        factors = (bulk, membrane, flexure)
        first, second, third = (factor * mean for factor, mean in zip(factors, means, strict=True))
        return cls((first, second, third))

    def eigenvalue(self, number: float) -> float:
        """Value [rad^2/s^2] that about `number` eigenvalues, one at least, lie below."""
        from scipy.optimize import brentq  # Its import takes long.

        number = max(number, 1.0)
        cubic, square, linear = self.terms

        def excess(logarithm: float) -> float:
            omega = np.exp(logarithm)
            return float(np.log((cubic * omega**3 + square * omega**2 + linear * omega) / number))

        # There one term alone reaches the number, and at a third of it none a third of the number.
        terms = enumerate(self.terms)
        highest = min(np.log(number / term) / (3 - place) for place, term in terms)
        return float(np.exp(2.0 * brentq(excess, highest - np.log(3.0), highest)))


def _equivalent(solid: Solid) -> tuple[Array | float, float]:
    """Factor (m,) by which moduli of cells become those of isotropic ones of the mean density, as
    fast for waves, and the mean of their Poisson's ratios."""
    regions = solid.regions
    pairs = np.array([law.isotropic_equivalent() for law in regions.laws])
    factors = pairs[:, 0] * solid.density / regions.density
    if solid.region is None:
        return float(factors[0]), float(pairs[0, 1])
    region = solid.region if solid.region.ndim == 1 else solid.region[:, 0]
    return factors[region], float(pairs[region, 1].mean())


def _regions(grid: NDArray[np.integer], young: Array, size: float) -> tuple[Array, Array]:
    """Geometric means of moduli (m,) in cubes of `size` cells, and the share of cells in each."""
    logarithms = np.log(young)
    place = (grid // max(1, round(size))).astype(np.int64)
    extent = place.max(axis=0) + 1
    number = np.ravel_multi_index(tuple(place.T), tuple(extent))
    _, region = np.unique(number, return_inverse=True)
    cells = np.bincount(region)
    return np.exp(np.bincount(region, logarithms) / cells), cells / len(grid)


def clusters(values: Array, gap: float = CLUSTER_GAP) -> list[slice]:
    """Runs of ascending `values` whose neighbours are relatively closer than `gap`.

    Examples
    --------
    >>> clusters(np.array([1.0, 2.0, 2.0001, 3.0]))
    [slice(0, 1, None), slice(1, 3, None), slice(3, 4, None)]
    """
    breaks = np.flatnonzero(np.diff(values) > gap * values[1:]) + 1
    bounds = [0, *breaks.tolist(), len(values)]
    return [slice(start, stop) for start, stop in zip(bounds[:-1], bounds[1:], strict=True)]
