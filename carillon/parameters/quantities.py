"""Annotations of the quantities that commands, files and calls share: limits, unit and meaning."""

from typing import Annotated, TypeVar

from carillon.limits import DENSITIES, MODULI, POISSON, RESOLUTIONS, UNITS
from carillon.parameters.model import OneOf, Within
from carillon.processes.threads import allowed_cores

T = TypeVar("T")

LARGEST = 2**63 - 1
"""Largest whole number that files and compiled code can hold."""
MOST_UNKNOWNS = 2**31 - 1
"""Largest number of unknowns of a model, and so of its modes."""

MOST_WORKERS = 64
"""Processes or threads that one command may start on a machine of few cores."""
WORKERS_OF_CORE = 4
"""Processes or threads that one command may start for each core of a machine with more."""


def between(low: float, high: float) -> Within:
    """Mark of numbers within limits, both of them included."""
    return Within(ge=low, le=high)


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
Workers = Annotated[int, between(1, max(MOST_WORKERS, WORKERS_OF_CORE * allowed_cores()))]
"""A number of processes or threads, no more than this machine could bear."""
Positive = Annotated[float, Within(gt=0.0)]
NonNegative = Annotated[float, Within(ge=0.0)]
Seed = Annotated[int, between(0, LARGEST), "seed of random numbers"]

Mesh = Annotated[str, "either builtin:NAME or a mesh file"]
Resolution = Annotated[
    int, between(*RESOLUTIONS), "voxels, or lattice spacings, along the longest side [1]"
]
Discretisation = Annotated[
    str,
    OneOf("voxel", "finite-cell"),
    "cubes that are full or empty (voxel), or quadratic cells of twice their edge of which only "
    "what is inside counts (finite-cell)",
]
MetresPerUnit = Annotated[float, between(*UNITS), "metres per unit of the mesh's coordinates [m]"]
Fill = Annotated[str, OneOf("winding", "centre", "orthographic"), "which voxels the surface fills"]
Components = Annotated[
    str,
    OneOf("error", "largest"),
    "either error, which rejects voxels in several pieces, or largest, which keeps one",
]
Density = Annotated[float, between(*DENSITIES), "mass density [kg/m^3]"]
PoissonRatio = Annotated[float, Within(gt=POISSON[0], lt=POISSON[1]), "Poisson's ratio [1]"]
YoungsModulus = Annotated[float, between(*MODULI), "Young's modulus [Pa]"]
Tolerance = Annotated[float, between(1e-15, 1.0), "relative error that double precision can reach"]
NumberOfModes = Annotated[
    int, between(1, MOST_UNKNOWNS), "number of modes, rigid ones included [1]"
]
