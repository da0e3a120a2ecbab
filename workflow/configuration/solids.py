"""The solids of a run, and those that studies have of their own."""

import re
from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY
from typing import Annotated, Any, TypeVar

from annotated_types import Ge, Le, MaxLen, MinLen

from carillon.builtin_names import BUILTIN_NAMES, BUILTIN_PREFIX
from carillon.fem.materials import NAMES as MATERIALS
from carillon.parameters import REQUIRED, Check, OneOf, Within, option, parameters
from carillon.parameters.documents import parameters_from
from carillon.parameters.quantities import (
    Components,
    Density,
    Discretisation,
    Fill,
    MetresPerUnit,
    NumberOfModes,
    Resolution,
    Seed,
    UpAxis,
    WallSide,
    WallThickness,
)
from carillon.parameters.sentences import did_you_mean
from workflow.configuration.section import File, Line, Several, Title

FILES = {"bunny": "stanford-bunny.obj", "teapot": "teapot.obj"}
"""Mesh files of solids that studies measure by default, beside built-in ones of their own names."""
LONGEST_SOLID = 64
"""Longest name of a solid in characters."""
_NAME = re.compile(r"[a-z0-9][a-z0-9-]*")


def _known(mesh: str) -> str:
    if mesh.startswith(BUILTIN_PREFIX) and mesh.removeprefix(BUILTIN_PREFIX) not in BUILTIN_NAMES:
        hint = did_you_mean(mesh.removeprefix(BUILTIN_PREFIX), BUILTIN_NAMES)
        known = ", ".join(BUILTIN_NAMES)
        raise ValueError(f"{mesh}: no such built-in object{hint}, expected one of {known}")
    return mesh


Entry = TypeVar("Entry")


def _plainly_named(solids: dict[str, Entry]) -> dict[str, Entry]:
    for name in solids:
        if not _NAME.fullmatch(name) or len(name) > LONGEST_SOLID:
            raise ValueError(
                f"{name!r} is no name of a solid, expected lower-case letters, digits and "
                f"hyphens, {LONGEST_SOLID} at most"
            )
    return solids


Mesh = Annotated[File, Check(_known), "either builtin:NAME or a file below mesh_folder"]
Material = Annotated[str, OneOf(*MATERIALS)]
Materials = Annotated[Several[Material], "named materials that every solid is given"]
ModelModes = Annotated[
    NumberOfModes,
    Within("pages list them all and compare half a dozen elastic ones", ge=12, le=10_000),
    "modes computed, rigid ones included [1]",
]
Place = Annotated[Line, Within(min_length=1, max_length=1000)]
Coordinate = Annotated[float, Ge(-1e12), Le(1e12)]
Point = tuple[Coordinate, Coordinate, Coordinate]
Solids = Annotated[
    dict[str, Entry],
    MinLen(1),
    MaxLen(1000),
    Check(_plainly_named),
    "the solids, by name; one whose mesh file is absent is left out",
]
StudiedForests = Annotated[
    File | None,
    "forests that the solids are coarsened by, relative to the working directory; those of the "
    "package if null",
]


@parameters
class SolidEntry:
    """A solid of a study."""

    _: KW_ONLY
    title: Title = option("", "name on pages; made from the solid's name if empty")
    mesh: Mesh = option(REQUIRED)
    components: Components = option("error")


@parameters
class StudiedSolid(SolidEntry):
    """A solid that is studied at several resolutions."""

    _: KW_ONLY
    resolutions: Several[Resolution] = option(
        REQUIRED, "voxels along the longest side of the bounding box, each studied [1]"
    )


def default_solids(
    model: type[Entry], values: Mapping[str, Mapping[str, Any]]
) -> Callable[[], dict[str, Entry]]:
    """Solids that a study measures by default, from the keys of each but its mesh."""
    return lambda: {
        name: parameters_from({"mesh": FILES.get(name, f"{BUILTIN_PREFIX}{name}"), **given}, model)
        for name, given in values.items()
    }


@parameters
class ModelEntry(SolidEntry):
    """A solid of the run."""

    _: KW_ONLY
    resolution: Resolution = option(REQUIRED)
    discretisation: Discretisation = option(
        "voxel",
        "either voxel, cubes that are full or empty, or finite-cell, cells of degree 4 of which "
        "only what is inside counts, which are not coarsened",
    )
    wall: WallThickness | None = option(None)
    wall_side: WallSide = option("about")
    material: File = option(
        "smooth",
        f"one of {', '.join(MATERIALS)}, or a file with one modulus per voxel [Pa]",
    )
    regions: File | None = option(
        None,
        "YAML file with the regions of the solid and what holds it, as of `carillon modes "
        "--regions`; moduli of the material are then over 1 GPa, as factors on the regions' own, "
        "and density and Poisson's ratio are theirs",
    )
    fix: Annotated[tuple[Place, ...], Within(max_length=1000)] | None = option(
        None, "what is held: comparisons of x, y and z [m], or region:NAME; nothing if null"
    )
    unit: MetresPerUnit = option(1.0)
    up: UpAxis | None = option(None)
    density: Density = option(1000.0)
    lumped: bool = option(
        False, "whether the mass of voxels is lumped at the nodes, as in Eq. (13) of the paper"
    )
    seed: Seed = option(0, "seed of the material and of the partition")
    fill: Fill = option(
        "winding",
        "which voxels the surface fills, winding for those at least half inside and those that "
        "hold them together, centre for those whose centre is inside, orthographic for all between "
        "the outermost ones",
    )
    strike: Point | None = option(
        None,
        "point of the surface where the validation strikes the solid, in the mesh's own "
        "coordinates; chosen by the ground truth if null [mesh unit]",
    )
    observed: Point | None = option(
        None,
        "point of the surface whose motion after the strike is compared, in the mesh's own "
        "coordinates; chosen by the ground truth if null [mesh unit]",
    )
    modes: ModelModes | None = option(
        None, "modes of this model, rigid ones included; solver.modes if null [1]"
    )

    def __post_init__(self) -> None:
        if self.wall is not None and self.discretisation == "voxel":
            raise ValueError(
                "found a wall of voxels, expected discretisation: finite-cell, or no wall"
            )
