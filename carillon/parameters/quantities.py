"""Annotations of the quantities that commands, files and calls share: limits, unit and meaning."""

import re
from typing import Annotated, Any, TypeVar

from carillon.limits import DENSITIES, FEWEST_MODES, MODULI, POISSON, RESOLUTIONS, UNITS
from carillon.parameters.model import Check, OneOf, Within
from carillon.processes.threads import allowed_cores

T = TypeVar("T")

LARGEST = 2**63 - 1
"""Largest whole number that files and compiled code can hold."""
MOST_UNKNOWNS = 2**31 - 1
"""Largest number of unknowns of a model, and so of its modes."""

LEAST_TOLERANCE = 1e-15
"""Smallest relative tolerance that double precision can reach."""

MOST_WORKERS = 1024
"""Processes or threads that a file may ask of the machine that it is meant for."""
WORKERS_OF_MACHINE = 64
"""Processes or threads that one command may start on a machine of few cores."""
WORKERS_OF_CORE = 4
"""Processes or threads that one command may start for each core of a machine with more."""


LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "in": 0.0254}
"""Units of lengths in texts, in metres."""
UP_AXES = ("x", "y", "z", "-x", "-y", "-z")
"""Axes of a mesh that may point up."""
_LENGTH = re.compile(r"([-+]?[0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?) *([a-zµ]+)")


def between(low: float, high: float) -> Within:
    """Mark of numbers within limits, both of them included."""
    return Within(ge=low, le=high)


def _printable(name: str) -> str:
    if name.isspace() or not name.isprintable():
        raise ValueError(
            f"found {name!r}, expected characters that can be printed, and not blanks alone"
        )
    return name


def _bearable(workers: int) -> int:
    cores = allowed_cores()
    most = max(WORKERS_OF_MACHINE, WORKERS_OF_CORE * cores)
    if workers > most:
        raise ValueError(
            f"found {workers:,}, expected at most {most:,}, since {cores:,} cores are usable here"
        )
    return workers


def _length(value: Any) -> Any:
    """A length [m] from a text with a unit; what is no text as it is.

    Examples
    --------
    >>> _length("0.8 mm"), _length(0.002)
    (0.0008, 0.002)
    """
    if not isinstance(value, str):
        return value
    found = _LENGTH.fullmatch(value.strip())
    if found is None or found[2] not in LENGTHS:
        raise ValueError(
            f"found {value!r}, expected a number of metres, or a length such as '0.8 mm' in one of "
            f"{', '.join(LENGTHS)}"
        )
    return float(found[1]) * LENGTHS[found[2]]


def _unit(value: Any) -> Any:
    """Metres per unit from the unit's name; what is no text as it is.

    Examples
    --------
    >>> _unit("mm"), _unit(0.001)
    (0.001, 0.001)
    """
    if not isinstance(value, str):
        return value
    if value.strip() not in LENGTHS:
        raise ValueError(
            f"found {value!r}, expected one of {', '.join(LENGTHS)}, or a number of metres per unit"
        )
    return LENGTHS[value.strip()]


def unit_in_words(metres: float) -> str | float:
    """Name of a unit of so many metres; the number if it has none.

    Examples
    --------
    >>> unit_in_words(0.001), unit_in_words(0.3048)
    ('mm', 0.3048)
    """
    return next((name for name, each in LENGTHS.items() if each == metres), metres)


def _reachable(tolerance: float) -> float:
    if 0.0 < tolerance < LEAST_TOLERANCE:
        raise ValueError(
            f"found {tolerance:g}, expected {LEAST_TOLERANCE:g} to 1, or 0 for no tolerance"
        )
    return tolerance


Pair = tuple[T, T]
Triple = tuple[T, T, T]
File = Annotated[str, Within(min_length=1, max_length=4000)]
"""Path of a file."""
Coordinate = Annotated[float, between(-1e18, 1e18)]
Point = Annotated[Triple[Coordinate], "a position [m]"]
Count = Annotated[int, between(1, LARGEST)]
"""A number of things, one at least."""
Number = Annotated[int, between(0, LARGEST)]
"""A number of things or of one of them, counted from 0."""
WorkersAnywhere = Annotated[int, between(1, MOST_WORKERS)]
"""A number of processes or threads, on whatever machine."""
Workers = Annotated[WorkersAnywhere, Check(_bearable)]
"""A number of processes or threads, no more than this machine could bear."""
ShownName = Annotated[str, Within(min_length=1, max_length=100), Check(_printable)]
"""A name that messages and pages show."""
Positive = Annotated[float, Within(gt=0.0)]
NonNegative = Annotated[float, Within(ge=0.0)]
Length = Annotated[float, Within(gt=0.0, le=1e9), Check(_length, before=True, besides=True)]
"""A length [m], or a text with a unit such as 0.8 mm."""
Seed = Annotated[int, between(0, LARGEST), "seed of random numbers"]

Mesh = Annotated[str, "either builtin:NAME or a mesh file"]
Resolution = Annotated[
    int, between(*RESOLUTIONS), "voxels, or lattice spacings, along the longest side [1]"
]
Discretisation = Annotated[
    str,
    OneOf("voxel", "finite-cell"),
    "cubes that are full or empty (voxel), or cells of degree 4 and of four times their edge of "
    "which only what is inside counts (finite-cell)",
]
MetresPerUnit = Annotated[
    float,
    between(*UNITS),
    Check(_unit, before=True, besides=True),
    "unit of the mesh's coordinates: m, cm, mm, um or in, or a number of metres [m]",
]
UpAxis = Annotated[
    str,
    OneOf(*UP_AXES),
    "axis of the mesh file that points up: the solid is turned so that it becomes z, and all "
    "coordinates are those of the turned solid; null leaves the axes of the file",
]
Fill = Annotated[str, OneOf("winding", "centre", "orthographic"), "which voxels the surface fills"]
Components = Annotated[
    str,
    OneOf("error", "largest"),
    "either error, which rejects voxels in several pieces, or largest, which keeps one",
]
WallThickness = Annotated[
    Length,
    "thickness of a wall that follows the mesh, in place of what the mesh encloses: of finite "
    "cells, as text with a unit, such as 0.8 mm, or as number [m]",
]
WallSide = Annotated[
    str,
    OneOf("about", "inside", "outside"),
    "where the wall lies: half of it on each side of the mesh (about), or all on one",
]
Density = Annotated[float, between(*DENSITIES), "mass density [kg/m^3]"]
PoissonRatio = Annotated[float, Within(gt=POISSON[0], lt=POISSON[1]), "Poisson's ratio [1]"]
RayleighDamping = Annotated[
    Pair[Annotated[float, between(0.0, 1e9)]],
    "Rayleigh's coefficients of mass [1/s] and of stiffness [s]",
]
YoungsModulus = Annotated[float, between(*MODULI), "Young's modulus [Pa]"]
Tolerance = Annotated[
    float, between(LEAST_TOLERANCE, 1.0), "relative error that double precision can reach"
]
ToleranceOrNone = Annotated[float, between(0.0, 1.0), Check(_reachable)]
"""The same, or 0 for none."""
Corrections = Annotated[int, between(0, 10_000)]
"""A number of steps of error correction."""
NumberOfModes = Annotated[
    int,
    Within(f"the first {FEWEST_MODES - 1} are rigid motions", ge=FEWEST_MODES, le=MOST_UNKNOWNS),
    "number of modes, rigid ones included [1]",
]
NumberOfUnknowns = Annotated[int, between(1, MOST_UNKNOWNS)]
