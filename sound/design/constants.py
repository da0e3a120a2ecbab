"""Constants of a solid's regions that a search is free to choose, beside the field of moduli."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.fem.elasticity import Elasticity
from carillon.fem.regions import Regions

MARGIN = 1e-3
"""Share of the span of bounds, at either end, that no start lies in."""


@dataclass(frozen=True)
class Bounded:
    """A number between bounds, as a function of a coordinate; `start` belongs to 0."""

    low: float
    high: float
    start: float

    def at(self, coordinate: float) -> float:
        """The number: a logistic function, so that it stays within the bounds."""
        share = 1.0 / (1.0 + np.exp(-coordinate) * (self.high - self.start) / self._above)
        return float(self.low + (self.high - self.low) * share)

    def slope(self, number: float) -> float:
        """Derivative of the number by the coordinate."""
        return (number - self.low) * (self.high - number) / (self.high - self.low)

    def coordinate(self, number: float) -> float:
        """Inverse of `at`; numbers out of the bounds are moved into them."""
        margin = MARGIN * (self.high - self.low)
        inside = float(np.clip(number, self.low + margin, self.high - margin))
        odds = (inside - self.low) / (self.high - inside)
        return float(np.log(odds * (self.high - self.start) / self._above))

    @property
    def _above(self) -> float:
        return self.start - self.low


@dataclass(frozen=True)
class FreeRegion:
    """A constant of a region, in all of its rows of the table."""

    name: str
    rows: tuple[int, ...]
    number: Bounded


@dataclass(frozen=True)
class FreeConstants:
    """Poisson's ratios that one coordinate moves together, and densities with one each.

    The coordinate of Poisson's ratios comes first.
    """

    poisson: tuple[FreeRegion, ...] = ()
    density: tuple[FreeRegion, ...] = ()

    @classmethod
    def of_poisson(cls, number: Bounded) -> FreeConstants:
        """Poisson's ratio of a solid of one material."""
        return cls(poisson=(FreeRegion("solid", (0,), number),))

    def __len__(self) -> int:
        return bool(self.poisson) + len(self.density)

    @property
    def first_density(self) -> int:
        """Place of the first density among the coordinates."""
        return int(bool(self.poisson))

    def regions(self, coordinates: Array, table: Regions) -> Regions:
        """The materials of a table with the constants of some coordinates."""
        if not len(self):
            return table
        laws, density = list(table.laws), table.density.copy()
        for each in self.poisson:
            for row in each.rows:
                laws[row] = Elasticity.isotropic(each.number.at(coordinates[0]))
        for each, coordinate in zip(self.density, coordinates[self.first_density :], strict=True):
            density[list(each.rows)] = each.number.at(coordinate)
        return replace(table, laws=tuple(laws), density=density)

    def coordinates(self, regions: Regions) -> Array:
        """Coordinates of the materials of a table with the same names; 0 of others."""
        found = np.zeros(len(self))
        rows = {name: row for row, name in reversed(list(enumerate(regions.names)))}
        for each in self.poisson[:1]:
            ratio = regions.laws[rows[each.name]].poisson if each.name in rows else None
            if ratio is not None:
                found[0] = each.number.coordinate(ratio)
        for place, each in enumerate(self.density, start=self.first_density):
            if each.name in rows:
                found[place] = each.number.coordinate(regions.density[rows[each.name]])
        return found


NOTHING = FreeConstants()
"""No constant is free."""

Bounds = tuple[float, float] | None


def free_poisson(table: Regions, bounds: Bounds, names: Sequence[str]) -> tuple[FreeRegion, ...]:
    """Free Poisson's ratios of named regions, or of all isotropic ones.

    Raises UserError for a region that there is not, or is not isotropic, or whose ratio is not
    between the bounds.
    """
    if bounds is None:
        return ()
    rows = _rows(table, names, "material.poisson_regions")
    free = []
    for name, own in rows.items():
        ratio = table.laws[own[0]].poisson
        if ratio is None:
            if not names:
                continue
            raise UserError(
                f"material.poisson_regions: region {name!r} has elasticity of its own along each "
                "axis and no Poisson's ratio; leave it out"
            )
        free.append(_free(name, own, bounds, ratio, "material.poisson_bounds", "Poisson's ratio"))
    return tuple(free)


def free_density(
    table: Regions, bounds: Bounds, names: Sequence[str], has_scale: bool
) -> tuple[FreeRegion, ...]:
    """Free densities of named regions, or of all.

    Raises UserError for a region that there is not, or whose density is not between the bounds; or
    if the solid is of one, unless supports give it a scale of its own.
    """
    if bounds is None:
        return ()
    rows = _rows(table, names, "material.density_regions")
    if len(set(table.names)) == 1 and not has_scale:
        raise UserError(
            "material.density_bounds: a density that all of the solid has changes no ratio of "
            "frequencies; name several regions, or leave the bounds out"
        )
    return tuple(
        _free(
            name,
            own,
            bounds,
            float(table.density[own[0]]),
            "material.density_bounds",
            "density [kg/m^3]",
        )
        for name, own in rows.items()
    )


def _rows(table: Regions, names: Sequence[str], key: str) -> dict[str, tuple[int, ...]]:
    """Rows of the table by the names of regions, of all if none is named."""
    rows: dict[str, list[int]] = {}
    for row, name in enumerate(table.names):
        rows.setdefault(name, []).append(row)
    for name in names:
        if name not in rows:
            known = ", ".join(map(repr, rows))
            raise UserError(f"{key}: there is no region {name!r}; the solid has {known}")
    return {name: tuple(own) for name, own in rows.items() if name in names or not names}


def _free(
    name: str, rows: tuple[int, ...], bounds: tuple[float, float], start: float, key: str, what: str
) -> FreeRegion:
    low, high = bounds
    if not low < start < high:
        raise UserError(
            f"{key}: found {list(bounds)}, expected the {what} of region {name!r}, from which the "
            f"search starts, between them; it is {start:g}"
        )
    return FreeRegion(name, rows, Bounded(low, high, start))
