"""A project: the file that describes a sound design."""

from collections.abc import Mapping
from dataclasses import KW_ONLY, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from carillon.arrays import Surface
from carillon.builtin_names import in_folder
from carillon.composition.entries import CompositionEntry, RegionEntry, SupportEntry
from carillon.fem.element import DEFAULT_POISSON
from carillon.fem.model import DEFAULT_DENSITY
from carillon.parameters import REQUIRED, OneOf, Within, option, parameters
from carillon.parameters.documents import document_of, parameters_from, read_parameters
from carillon.parameters.fields import parameters_of
from carillon.parameters.quantities import (
    Components,
    Density,
    Discretisation,
    File,
    Fill,
    MetresPerUnit,
    PoissonRatio,
    Resolution,
    UpAxis,
    WallSide,
    WallThickness,
    between,
)
from carillon.parameters.sentences import ParameterError
from solver.analysis.problem import AUTO, ProblemOptions
from solver.coarsening.choice import LINEAR
from solver.coarsening.forest import FOREST
from sound.project.build import BuildSettings
from sound.project.settings import (
    DampingSettings,
    ListenSettings,
    MaterialSettings,
    OptimiserSettings,
    TargetEntry,
    Weights,
)
from sound.strikes import Place, Strike, locate_all, struck_surface


@parameters
class Project:
    """A solid, what its struck points shall sound like, and how a material is sought.

    Once it is loaded, its paths hold in the working directory, and its coarsening is the one that
    auto stands for.  `modes` is a number once the clips are known, see `sound.design.preparation`.
    """

    _: KW_ONLY
    mesh: File = option(REQUIRED, "either builtin:NAME or a mesh file, relative to the project")
    resolution: Resolution = option(32)
    unit: MetresPerUnit = option(1.0)
    up: UpAxis | None = option(None)
    fill: Fill = option("winding")
    components: Components = option("error")
    poisson: PoissonRatio = option(DEFAULT_POISSON)
    density: Density = option(DEFAULT_DENSITY)
    regions: Annotated[tuple[RegionEntry, ...], Within(max_length=1000)] = option(
        (),
        "what the solid is made of, in place of poisson, density and material.young: regions in "
        "their order, of several in one place the last one counts; a search finds a factor on "
        "their moduli",
    )
    supports: Annotated[tuple[SupportEntry, ...], Within(max_length=1000)] = option(
        (), "what holds the solid, or is fixed to it; it is free if there are none"
    )
    coarsen: Annotated[str, OneOf(AUTO, "none", *LINEAR, FOREST)] = option(
        AUTO,
        "how the mesh that is simulated is made from the voxels; none simulates them all, auto is "
        "ddfem for voxels, and none for finite cells and regions of wood",
    )
    discretisation: Discretisation = option("voxel")
    wall: WallThickness | None = option(None)
    wall_side: WallSide = option("about")
    forest: File | None = option(
        None, "file of forests for ddfem, relative to the project; those of the package if null"
    )
    modes: Annotated[int, between(2, 10_000)] | Literal["auto"] = option(
        "auto",
        "elastic modes whose frequencies and amplitudes are controlled, relative to the first; "
        "auto takes the partials that are heard of the clips, 30 at most, and modes between them "
        "that stay silent "
        "[1]",
    )
    targets: Annotated[tuple[TargetEntry, ...], Within(min_length=1, max_length=100)] = option(
        REQUIRED, "struck points and the clips that they shall sound like"
    )
    material: MaterialSettings = option(
        MaterialSettings, "the Young's modulus field that is sought"
    )
    listen: ListenSettings = option(
        ListenSettings, "where the design is heard, if its amplitudes are to be those of a place"
    )
    damping: DampingSettings = option(DampingSettings, "how the modes of a design are damped")
    build: BuildSettings = option(
        BuildSettings, "real materials that the design is built of, once the field is found"
    )
    weights: Weights = option(Weights, "weights of the parts of the cost")
    optimiser: OptimiserSettings = option(
        OptimiserSettings, "how the material is sought and when the search stops"
    )

    def __post_init__(self) -> None:
        if self.regions:
            self._require_regions_alone()
        if self.coarsen == AUTO and not self.composition.is_isotropic:
            object.__setattr__(self, "coarsen", "none")
        object.__setattr__(self, "coarsen", self.solid.coarsen)
        if self.build.is_asked:
            self._require_buildable()
        bounds = self.material.poisson_bounds
        place = ("material", "poisson_bounds")
        if bounds is not None and not self.regions and not bounds[0] < self.poisson < bounds[1]:
            raise ParameterError(
                place,
                f"found {list(bounds)}, expected poisson, which the search starts from, between "
                f"them; it is {self.poisson:g}",
            )

    def _require_regions_alone(self) -> None:
        """Refuse what the regions say already."""
        material = self.material.young, parameters_of(MaterialSettings)["young"].default
        for place, value, default in (
            (("poisson",), self.poisson, DEFAULT_POISSON),
            (("density",), self.density, DEFAULT_DENSITY),
            (("material", "young"), *material),
        ):
            if value != default:
                raise ParameterError(
                    place, f"found {value:g} beside regions, which tell it; leave one of them out"
                )

    def _require_buildable(self) -> None:
        """Refuse a build of materials that there are not, or of what has no voxels of its own."""
        self.build.choices()
        if self.discretisation != "voxel":
            raise ParameterError(
                ("build",),
                f"found discretisation: {self.discretisation}, expected voxel; cells that the "
                "surface cuts are not parts that can be made",
            )
        if self.listen.at is not None and self.build.size == "free":
            raise ParameterError(
                ("build", "size"),
                "found free beside listen, expected mesh; a solid of another size radiates "
                "otherwise",
            )
        if self.build.per == "region" and len(self.regions) < 2:
            raise ParameterError(
                ("build", "per"),
                "found region and fewer than two regions; name regions, or take per: voxel",
            )

    @property
    def composition(self) -> CompositionEntry:
        """Regions and supports."""
        return CompositionEntry(self.regions, self.supports)

    @property
    def solid(self) -> ProblemOptions:
        """The solid to analyse, by the keys that both have but the material and the regions."""
        own = {"material", "regions"}
        shared = (parameters_of(ProblemOptions).keys() & parameters_of(Project)) - own
        return ProblemOptions(**{key: getattr(self, key) for key in shared})

    def as_dict(self) -> dict[str, Any]:
        """The project as its file has it, with all defaults and its paths as they are here."""
        return document_of(self)

    def surface(self) -> Surface:
        """Surface that is struck, in metres; raises UserError if there is no such mesh."""
        solid = self.solid
        return struck_surface(solid.mesh, solid.unit, wall=solid.wall_size, up=solid.up)

    def strikes(self, surface: Surface) -> list[Strike]:
        """The targets' points on `surface`, which `Project.surface` made.

        Raises UserError if one is far from the surface, or two are at one place; see
        `sound.strikes`.
        """
        places = [Place(target.name, target.at, target.vertex) for target in self.targets]
        return locate_all(surface, places, self.solid.unit)


def load_project(path: str | Path) -> Project:
    """Read a project file (YAML), but none of the files that it names.

    Raises UserError with one sentence about the first thing that is wrong with it.
    """
    return _in_folder(read_parameters(path, Project, "a project"), Path(path).parent)


def project_of(described: Mapping[str, Any], folder: Path) -> Project:
    """The project that the keys and values of a file in `folder` describe.

    Raises UserError with one sentence about the first thing that is wrong.
    """
    return _in_folder(parameters_from(described, Project), folder)


def with_optimiser(project: Project, **given: Any) -> Project:
    """The project with other settings of its optimiser; those that are None stay as they are.

    Raises UserError if one is beyond what projects may have.
    """
    changes = {key: value for key, value in given.items() if value is not None}
    return replace(project, optimiser=replace(project.optimiser, **changes))


def _in_folder(project: Project, folder: Path) -> Project:
    """The project with its paths, which are relative to a folder, as the working directory has."""
    return replace(
        project,
        mesh=in_folder(project.mesh, folder),
        regions=tuple(each.in_folder(folder) for each in project.regions),
        forest=None if project.forest is None else str(folder / project.forest),
        targets=tuple(replace(each, clip=str(folder / each.clip)) for each in project.targets),
    )
