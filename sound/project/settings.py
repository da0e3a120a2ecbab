"""Sections of a project: its targets, and how a material is sought that sounds like them."""

from typing import Annotated

from carillon.parameters import REQUIRED, Check, OneOf, Within, option, parameters
from carillon.parameters.quantities import (
    Density,
    File,
    Pair,
    Point,
    ShownName,
    WorkersAnywhere,
    YoungsModulus,
    between,
)
from sound.clips.formats import CLIP_FORMATS
from sound.radiation.far_place import RADIATIONS, FarPlace

LEAST_WEIGHT = 1e-12
"""Weight of frequencies or of amplitudes below which a search has nothing to lower."""


def _ascending(bounds: tuple[float, float]) -> tuple[float, float]:
    if not bounds[0] < bounds[1]:
        raise ValueError(f"found {list(bounds)}, expected the lower one first")
    return bounds


ModeCount = Annotated[int, between(1, 10_000)]
PlaceRadiation = Annotated[str, OneOf(*RADIATIONS)]
Dampings = Annotated[str, OneOf("clips", "material")]
"""Where dampings of a design come from."""
OptimiserMethod = Annotated[str, OneOf("hybrid", "cma", "bfgs")]
RegionNames = Annotated[tuple[ShownName, ...], Within(max_length=1000)]
Frequency = Annotated[float, Within(gt=0.0, le=1e6)]
Weight = Annotated[float, between(0.0, 1e9)]


@parameters
class TargetEntry:
    """One struck point, by its position or the number of its vertex."""

    name: ShownName = option(REQUIRED, "name of the point")
    clip: File = option(REQUIRED, f"file of the sound ({CLIP_FORMATS}), relative to the project")
    at: Point | None = option(
        None,
        "position on the surface in the mesh's own coordinates, as viewers of meshes show them, or "
        "as up turns them; the vertex nearest to it is struck [mesh unit]",
    )
    vertex: Annotated[int, between(0, 10**9)] | None = option(
        None, "number of the surface's vertex, from 0"
    )
    modes: ModeCount | None = option(
        None, "modes taken from this clip, its strongest; as many as it has if null [1]"
    )
    allow_clipped: bool = option(
        False, "whether the clip may be clipped; its samples at full scale are left out then"
    )
    without: Annotated[tuple[Frequency, ...], Within(max_length=1000)] = option(
        (),
        "frequencies of modes of the clip that are left out, such as those of a room or a hand "
        "[Hz]",
    )

    def __post_init__(self) -> None:
        if (self.at is None) == (self.vertex is None):
            given = "neither" if self.at is None else "both"
            raise ValueError(f"expected at or vertex, found {given}")


@parameters
class ListenSettings:
    """The place at which the amplitudes of a design are those of the clips."""

    at: Point | None = option(
        None,
        "position of the listener in the mesh's own coordinates, or as up turns them; what counts "
        "is the direction in which it lies from the centre of mass, as if it were far away. "
        "Amplitudes are those of the motion at the struck points if null [mesh unit]",
    )
    radiation: PlaceRadiation = option(
        RADIATIONS[0],
        "how the surface moves the air: as one of a sphere of its size does, or by "
        "boundary-elements as it is, which takes minutes once a mesh, and needs bempp-cl",
    )

    def __post_init__(self) -> None:
        if self.at is None and self.radiation != RADIATIONS[0]:
            raise ValueError(f"found radiation {self.radiation} without at, expected a place")

    def place(self, unit: float) -> FarPlace | None:
        """The place in the coordinates of a solid whose mesh has a unit [m]; None without one."""
        return FarPlace.of(self.at, unit, self.radiation)


@parameters
class MaterialSettings:
    """The Young's modulus field that is sought."""

    young: YoungsModulus = option(
        1e9, "modulus of the uniform material that the search starts from [Pa]"
    )
    dimensions: Annotated[int, between(2, 10_000)] = option(
        48,
        "smooth patterns over the solid that the field is made from, eigenvectors of the "
        "volumetric Laplacian [1]",
    )
    law: Annotated[str, OneOf("linear", "exponential")] = option(
        "exponential", "how the field follows from their sum; the exponential one reaches further"
    )
    young_bounds: Annotated[Pair[YoungsModulus], Check(_ascending)] | None = option(
        None,
        "lowest and highest modulus of the design, as far as another density of the whole brings "
        "them there, which frequencies do not feel; the density is kept if null [Pa]",
    )
    poisson_bounds: (
        Annotated[Pair[Annotated[float, between(-0.9, 0.49)]], Check(_ascending)] | None
    ) = option(
        None,
        "lowest and highest Poisson's ratio of the whole, which is then sought, too, from the one "
        "of poisson on; forests must be for all between, as those of the package are from 0 on. "
        "It is kept if null; those of regions each start from their own and move together [1]",
    )
    poisson_regions: RegionNames = option(
        (), "regions whose Poisson's ratio is sought; all isotropic ones if none is named"
    )
    density_bounds: Annotated[Pair[Density], Check(_ascending)] | None = option(
        None,
        "lowest and highest density of regions, each of which is then sought, too, from its own "
        "on; they are kept if null [kg/m^3]",
    )
    density_regions: RegionNames = option(
        (), "regions whose density is sought; all if none is named"
    )


@parameters
class DampingSettings:
    """How the modes of a design are damped."""

    source: Dampings = option(
        "clips",
        "where the dampings that sound come from, clips or material; the latter are those of the "
        "regions if they are known, else those of loss factors that are found after the search and "
        "come as near to the clips' as they can",
    )
    regions: Annotated[int, between(1, 100)] = option(
        4, "regions of the solid that have a loss factor each [1]"
    )


@parameters
class Weights:
    """Weights of the parts of the cost (Eq. 4)."""

    frequency: Weight = option(10.0, "weight of the differences of frequencies [1]")
    amplitude: Weight = option(1.0, "weight of the differences of amplitudes [1]")
    regulariser: Weight = option(1e-5, "weight of the roughness of the material [1]")

    def __post_init__(self) -> None:
        if max(self.frequency, self.amplitude) < LEAST_WEIGHT:
            raise ValueError(
                f"found {self.frequency:g} for frequency and {self.amplitude:g} for amplitude, "
                f"expected at least one of them to be {LEAST_WEIGHT:g} or more"
            )


@parameters
class OptimiserSettings:
    """How the material is sought and when the search stops."""

    method: OptimiserMethod = option(
        "hybrid", "either hybrid, or one of its two parts alone, cma or bfgs"
    )
    seconds: Annotated[float, Within(gt=0.0, le=1e8)] | None = option(
        60.0, "processor time of the search; no limit if null [s]"
    )
    evaluations: Annotated[int, between(1, 10**9)] | None = option(
        None,
        "evaluations that the search makes at most, each the modal analysis of one material, that "
        "of the start included, checks aside; no limit if null [1]",
    )
    seed: Annotated[int, between(0, 2**32 - 2)] = option(0, "seed of the search")
    population: Annotated[int, between(2, 10_000)] | None = option(
        None, "offspring of a generation; the strategy's choice if null [1]"
    )
    workers: WorkersAnywhere | None = option(
        None, "processes that evaluate candidates; one per core if null [1]"
    )
    fine_check: bool = option(
        True,
        "whether what is found on the coarse solid is checked, and aimed at anew, on the fine one",
    )
