"""Annotations of the quantities that commands, files and calls share: limits, unit and meaning."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Ge, Gt, Interval, Le, Lt

from carillon.limits import DENSITIES, MODULI, POISSON, RESOLUTIONS, UNITS
from carillon.parameters.model import OneOf

LARGEST = 2**63 - 1
"""Largest whole number that files and compiled code can hold."""
MOST_UNKNOWNS = 2**31 - 1
"""Largest number of unknowns of a model, and so of its modes."""


def between(limits: tuple[float, float]) -> Interval:
    """Mark of numbers within limits, both of them included."""
    return Interval(ge=limits[0], le=limits[1])


Count = Annotated[int, Ge(1), Le(LARGEST)]
"""A number of things, one at least."""
Number = Annotated[int, Ge(0), Le(LARGEST)]
"""A number of things or of one of them, counted from 0."""
Positive = Annotated[float, Gt(0.0)]
NonNegative = Annotated[float, Ge(0.0)]
Seed = Annotated[int, Ge(0), Le(LARGEST), "seed of random numbers"]

Mesh = Annotated[str, "either builtin:NAME or a mesh file"]
Resolution = Annotated[
    int, between(RESOLUTIONS), "voxels, or lattice spacings, along the longest side [1]"
]
Discretisation = Annotated[
    str,
    OneOf(("voxel", "finite-cell")),
    "cubes that are full or empty (voxel), or quadratic cells of twice their edge of which only "
    "what is inside counts (finite-cell)",
]
MetresPerUnit = Annotated[float, between(UNITS), "metres per unit of the mesh's coordinates [m]"]
Fill = Annotated[
    str, OneOf(("winding", "centre", "orthographic")), "which voxels the surface fills"
]
Components = Annotated[
    str,
    OneOf(("error", "largest")),
    "either error, which rejects voxels in several pieces, or largest, which keeps one",
]
Density = Annotated[float, between(DENSITIES), "mass density [kg/m^3]"]
PoissonRatio = Annotated[float, Gt(POISSON[0]), Lt(POISSON[1]), "Poisson's ratio [1]"]
YoungsModulus = Annotated[float, between(MODULI), "Young's modulus [Pa]"]
NumberOfModes = Annotated[int, Ge(1), Le(MOST_UNKNOWNS), "number of modes, rigid ones included [1]"]
