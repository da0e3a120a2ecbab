"""Section of a project: the real materials that a design may be built of."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from carillon.arrays import Array
from carillon.composition.entries import RegionEntry, Vector
from carillon.composition.materials import MATERIALS, named_material
from carillon.errors import UserError
from carillon.fem.geometry.size import length_in_words
from carillon.fem.regions import Regions
from carillon.parameters import REQUIRED, OneOf, Within, option, parameters
from carillon.parameters.fields import parameters_of
from carillon.parameters.quantities import (
    Density,
    Length,
    PoissonRatio,
    ShownName,
    YoungsModulus,
    between,
)
from carillon.parameters.sentences import alike

LEAST_FRACTION, MOST_LEVELS = 0.05, 20
"""Least fraction of an infill, below which walls do not hang together, and most of its levels."""
GREY = (0.6, 0.6, 0.6)
"""Colour of a material that has none."""
THINNEST = 0.4e-3
"""Width [m] of the line of a usual printer, below which nothing can be printed."""
ALIKE = 1e-3
"""Relative difference of all constants below which two materials are one and the same."""


@parameters
class OwnMaterial:
    """A material of the project itself."""

    name: ShownName = option(REQUIRED, "name by which materials and infill ask for it")
    material: str | None = option(None, "name of a material whose constants it has but for these")
    young: YoungsModulus | None = option(None, "Young's modulus, of wood along the grain [Pa]")
    poisson: PoissonRatio | None = option(None, "Poisson's ratio [1]")
    density: Density | None = option(None, "mass density [kg/m^3]")
    loss_factor: Annotated[float, between(0.0, 1.0)] | None = option(
        None, "loss factor at 1 kHz [1]"
    )
    grain: Vector | None = option(None, "direction of the grain of wood (x unless given)")
    radial: Vector | None = option(None, "direction across it")

    def row(self) -> Regions:
        """Its row in a table of materials.

        Raises UserError for a material that there is not, or constants that no material has.
        """
        given = {key: getattr(self, key) for key in parameters_of(OwnMaterial)}
        entry = RegionEntry(**given)
        row, axes = entry.row(), entry.axes()
        if not isinstance(axes, np.ndarray):
            return row
        return replace(row, laws=tuple(law.rotated(axes) for law in row.laws))


@parameters
class BuildSettings:
    """What a design may be built of; it stays a continuous field if nothing is named."""

    materials: Annotated[tuple[ShownName, ...], Within(max_length=20)] = option(
        (),
        "names of two or more materials, one of which each voxel or region becomes after the "
        "search: modulus, density, Poisson's ratio and damping are the material's",
    )
    own_materials: Annotated[tuple[OwnMaterial, ...], Within(max_length=20)] = option(
        (), "materials of the project itself"
    )
    infill: ShownName | None = option(
        None,
        "name of one material, such as pla, in place of several: what each voxel or region becomes "
        "is a fraction of it, which sets modulus and density",
    )
    least_infill: Annotated[float, between(LEAST_FRACTION, 0.95)] = option(
        0.15, "least fraction of the volume that is filled; the most is 1 [1]"
    )
    infill_levels: Annotated[int, between(2, MOST_LEVELS)] = option(
        6, "fractions that there are, evenly spaced, the least and 1 among them [1]"
    )
    infill_exponent: Annotated[float, between(1.0, 4.0)] = option(
        2.0,
        "exponent n of the modulus E0 phi^n at the fraction phi (Gibson and Ashby), by the "
        "pattern: 2 where its walls bend, 1 where they are stretched [1]",
    )
    per: Annotated[str, OneOf("voxel", "region")] = option(
        "voxel", "what is of one material: each voxel, or each of the project's regions as a whole"
    )
    at_least: Length | None = option(
        None,
        "edge of the cubes of voxels that are of one material, so that no part is thinner but "
        "where the surface cuts it; single voxels if null; as text with a unit, such as 6 mm [m]",
    )
    size: Annotated[str, OneOf("free", "mesh")] = option(
        "free",
        "whether the solid is made larger or smaller so that it has the pitch of its clips, or "
        "stays as large as its mesh; with springs or masses it stays",
    )
    evaluations: Annotated[int, between(1, 100_000)] = option(
        80,
        "modal analyses of the fine solid that choose the materials at most, those of the nearest "
        "materials included [1]",
    )

    def __post_init__(self) -> None:
        if self.materials and self.infill is not None:
            raise ValueError("expected materials or infill, found both")
        if len(self.materials) == 1:
            raise ValueError(
                f"found the material {self.materials[0]!r} alone, expected two or more, or infill "
                "of one"
            )
        if self.at_least is not None and self.per == "region":
            raise ValueError("at_least goes with per: voxel, found per: region; leave one out")
        for name in self.materials:
            if self.materials.count(name) > 1:
                raise ValueError(f"the material {name!r} is named twice; leave one out")

    @property
    def is_asked(self) -> bool:
        """Whether a design is to be built of real materials."""
        return bool(self.materials) or self.infill is not None

    def choices(self) -> Choices:
        """The materials that a voxel may be of.

        Raises UserError for a name that there is not, or two materials that are one and the same.
        """
        if self.infill is not None:
            return self._levels(self.infill)
        made = [self._material(name) for name in self.materials]
        _require_different([row for row, _ in made])
        order = sorted(range(len(made)), key=lambda each: float(made[each][0].young[0]))
        table = Regions.together([made[each][0] for each in order])
        colours = np.array([made[each][1] for each in order])
        return Choices(table, colours, np.ones(len(made)))

    def _levels(self, name: str) -> Choices:
        row, colour = self._material(name)
        fractions = np.linspace(self.least_infill, 1.0, self.infill_levels)
        rows = [
            replace(
                row,
                young=row.young * fraction**self.infill_exponent,
                density=row.density * fraction,
                names=(f"{name} {100.0 * fraction:.3g} %",),
            )
            for fraction in fractions
        ]
        white = 0.75 * (1.0 - fractions[:, None])
        return Choices(Regions.together(rows), white + (1.0 - white) * np.array(colour), fractions)

    def _material(self, name: str) -> tuple[Regions, tuple[float, float, float]]:
        own = {each.name: each for each in self.own_materials}
        if name in own:
            based = own[name].material
            return own[name].row(), GREY if based is None else named_material(based).colour
        if name not in MATERIALS:
            known = [*own, *MATERIALS]
            meant = alike(name, known)
            hint = f"; did you mean {meant}?" if meant else ""
            raise UserError(f"build: there is no material {name!r}, only {', '.join(known)}{hint}")
        material = named_material(name)
        return material.region(name), material.colour


@dataclass(frozen=True)
class Choices:
    """Materials that a voxel may be of, by ascending Young's modulus."""

    table: Regions
    colours: Array
    """(r, 3) red, green and blue from 0 to 1 (sRGB)."""
    fractions: Array
    """(r,) of the volume that is filled."""

    def __len__(self) -> int:
        return len(self.table)


def too_thin(width: float | None) -> str:
    """What is wrong with parts of a width [m] that cannot be printed; empty if they can.

    `width` is None where it is not known.

    Examples
    --------
    >>> too_thin(0.001), too_thin(1e-4)[:32]
    ('', 'parts are as thin as 0.1 mm, exp')
    """
    if width is None or width >= THINNEST:
        return ""
    return (
        f"parts are as thin as {length_in_words(width)}, expected {length_in_words(THINNEST)} or "
        "more, the width of a printer's line; set build.at_least to that, or a lower resolution"
    )


def _require_different(rows: list[Regions]) -> None:
    for place, one in enumerate(rows):
        for other in rows[:place]:
            mine, its = (each.young * each.elasticity[0] for each in (one, other))
            stiffness = np.abs(mine - its).max() <= ALIKE * np.abs(mine).max()
            if stiffness and np.isclose(one.density[0], other.density[0], rtol=ALIKE):
                raise UserError(
                    f"build.materials: {other.names[0]!r} and {one.names[0]!r} have the same "
                    "constants; name materials that differ"
                )
