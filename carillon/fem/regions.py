"""The materials of a solid's regions: a table with a row for each."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.fem.elasticity import (
    DEFAULT_POISSON,
    Elasticity,
    require_elasticity,
    young_moduli,
)
from carillon.limits import DENSITIES, MODULI, require_constants, require_within

DEFAULT_DENSITY = 1000.0
"""Mass density [kg/m^3] where none is given."""
MOST = 65_535
"""Largest number of regions, directions of a grain among them."""

Damping = tuple[float, float]
"""Rayleigh's coefficients of mass [1/s] and of stiffness [s]."""
RegionOf = NDArray[np.uint16]
"""Numbers of regions, rows of their table."""


@dataclass(frozen=True, eq=False)
class Regions:
    """The materials of a solid, one for each of its regions.

    A place has a Young's modulus [Pa] of its own, its region's `young` times a factor that a design
    may choose. Its elasticity is that modulus times the region's law.
    """

    laws: tuple[Elasticity, ...]
    """Elasticity over the modulus."""
    density: Array
    """(r,) mass density [kg/m^3]."""
    young: Array
    """(r,) modulus [Pa] of the material as it is in tables; of an anisotropic one the largest along
    its axes."""
    names: tuple[str, ...]
    damping: tuple[Damping | None, ...]
    """Rayleigh's coefficients of each, if they are known."""

    @classmethod
    def one(
        cls,
        poisson: float = DEFAULT_POISSON,
        density: float = DEFAULT_DENSITY,
        young: float = 1e9,
        damping: Damping | None = None,
        name: str = "solid",
    ) -> Regions:
        """An isotropic material.

        Raises UserError for constants that no material has.
        """
        require_constants(poisson, density)
        law = Elasticity.isotropic(float(poisson))
        return cls(
            (law,), np.array([float(density)]), np.array([float(young)]), (name,), (damping,)
        )

    @classmethod
    def anisotropic(
        cls,
        matrix: ArrayLike,
        density: float = DEFAULT_DENSITY,
        damping: Damping | None = None,
        name: str = "solid",
    ) -> Regions:
        """A material with an elasticity matrix (6, 6) [Pa].

        Its `young` is the largest Young's modulus along x, y and z. Raises UserError if it is not
        positive definite, or for constants that no material has.
        """
        given = require_elasticity(np.asarray(matrix), name)
        require_within(f"{name}: density {density:g} kg/m^3", density, DENSITIES)
        young = float(young_moduli(given).max())
        require_within(f"{name}: modulus {young:g} Pa", young, MODULI)
        law = Elasticity.of_matrix(given, young)
        return cls((law,), np.array([float(density)]), np.array([young]), (name,), (damping,))

    @classmethod
    def together(cls, parts: list[Regions]) -> Regions:
        """The rows of several tables, in their order."""
        laws, names, damping = (
            tuple(each for part in parts for each in getattr(part, name))
            for name in ("laws", "names", "damping")
        )
        if len(laws) > MOST:
            raise UserError(f"{len(laws):,} regions; expected {MOST:,} at most")
        density, young = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ("density", "young")
        )
        return cls(laws, density, young, names, damping)

    def __len__(self) -> int:
        return len(self.laws)

    def rows(self, chosen: NDArray[np.integer]) -> Regions:
        """Some of the rows."""
        laws, names, damping = (
            tuple(getattr(self, name)[row] for row in chosen)
            for name in ("laws", "names", "damping")
        )
        return Regions(laws, self.density[chosen], self.young[chosen], names, damping)

    @property
    def poisson(self) -> float | None:
        """Poisson's ratio, if all regions are isotropic and have the same."""
        ratios = {law.poisson for law in self.laws}
        return ratios.pop() if len(ratios) == 1 else None

    @property
    def mean_poisson(self) -> float:
        """Mean over the regions; of anisotropic materials that of all directions."""
        return float(np.mean([law.isotropic_equivalent()[1] for law in self.laws]))

    @property
    def ratios(self) -> tuple[float, ...]:
        """Poisson's ratios of the isotropic ones, ascending."""
        return tuple(sorted({law.poisson for law in self.laws if law.poisson is not None}))

    @cached_property
    def poissons(self) -> Array:
        """(r,) Poisson's ratios; NaN of anisotropic materials."""
        return np.array([np.nan if law.poisson is None else law.poisson for law in self.laws])

    @property
    def is_isotropic(self) -> bool:
        """Whether all regions are."""
        return all(law.poisson is not None for law in self.laws)

    @cached_property
    def elasticity(self) -> Array:
        """(r, 6, 6) the laws' matrices."""
        return np.array([law.matrix for law in self.laws])

    def scaled(self, density: float, young: float) -> Regions:
        """The same with other densities and moduli, by these factors."""
        return replace(self, density=density * self.density, young=young * self.young)

    def with_poisson(self, poisson: float) -> Regions:
        """The same with another Poisson's ratio of all isotropic regions."""
        law = Elasticity.isotropic(float(poisson))
        laws = tuple(law if each.poisson is not None else each for each in self.laws)
        return replace(self, laws=laws)

    def moduli(self, region: RegionOf | None, factor: ArrayLike = 1.0) -> Array:
        """Moduli (m,) [Pa] of the regions (m,) of places, times a factor of each."""
        of_place = self.young[0] if region is None else self.young[region]
        return np.asarray(of_place * np.asarray(factor, dtype=float))
