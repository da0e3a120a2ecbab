"""A scene: the file that describes solids, how they begin to move, and who hears them."""

from collections.abc import Mapping
from dataclasses import KW_ONLY, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

from carillon.builtin_names import BUILTIN_PREFIX, in_folder
from carillon.composition.entries import RegionEntry, SupportEntry
from carillon.composition.materials import NamedMaterial, named_material
from carillon.errors import UserError
from carillon.fem.geometry.turning import up_of_format
from carillon.fem.geometry.walls import WallSize
from carillon.limits import EXTENTS
from carillon.parameters import REQUIRED, Check, OneOf, Within, option, parameters
from carillon.parameters.documents import parameters_from, read_parameters
from carillon.parameters.fields import parameters_of
from carillon.parameters.quantities import (
    Components,
    Density,
    File,
    MetresPerUnit,
    Pair,
    Resolution,
    ShownName,
    Triple,
    UpAxis,
    WallSide,
    WallThickness,
    between,
)
from carillon.parameters.sentences import ParameterError

SOURCES = ("design", "modes", "mesh", "radius")
"""What an object may be, one of them."""
FILES = ("design", "modes", "mesh", "heard_modes")
"""Keys of an object that name files."""
GROUND_NAME = "ground"
"""What lists and scenes call the floor."""
STANDARD_MATERIAL = "plastic"
"""Name of the material of designs and modes files, for what these do not tell."""
_SUITS = {
    "unit": ("mesh",),
    "size": ("mesh",),
    "up": ("mesh", "modes", "design"),
    "accuracy": ("mesh", "radius"),
    "pitch": ("mesh", "radius"),
    "density": ("mesh", "radius"),
    "heard_modes": ("modes",),
    "damping": ("modes", "mesh", "radius"),
    "discretisation": ("mesh", "radius"),
    "wall": ("mesh",),
    "wall_side": ("mesh",),
    "components": ("mesh", "radius"),
    "regions": ("mesh", "modes", "design"),
    "supports": ("mesh",),
}
"""Keys of an object that have a meaning for some sources alone."""

_Coordinate = Annotated[float, between(-1000.0, 1000.0)]
Vector = Triple[_Coordinate]


def _material(name: Any) -> Any:
    if not isinstance(name, str):
        return name
    try:
        return named_material(name)
    except UserError as error:
        raise ValueError(str(error)) from None


def _in_time(path: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    if any(later[0] <= before[0] for before, later in zip(path, path[1:])):
        raise ValueError("expected times that ascend")
    return path


Material = Annotated[NamedMaterial, Check(_material, before=True)]
"""A material by its name."""


@parameters
class ObjectEntry:
    """A solid."""

    name: ShownName = option(REQUIRED, "what messages and pages call it")
    design: File | None = option(None, "design that it is (HDF5), relative to the scene")
    modes: File | None = option(
        None, "modes file of the solver that it is (HDF5), relative to the scene"
    )
    heard_modes: File | None = option(
        None,
        "modes file of the same solid by which it sounds in place of its own, so that two kinds of "
        "modes are heard of one motion",
    )
    mesh: File | None = option(
        None,
        "either builtin:NAME or a mesh file, relative to the scene; `up` says which axis points up",
    )
    radius: Annotated[float, between(1e-4, 100.0)] | None = option(
        None, "radius of a ball of one material [m]"
    )
    material: Material | None = option(
        None,
        "name of what it is made of, where regions do not tell; of a design or of modes it tells "
        "damping, roughness, friction and bounce alone",
    )
    regions: Annotated[tuple[RegionEntry, ...], Within(max_length=1000)] = option(
        (),
        "parts of a mesh that are of other materials, in axes whose z points up: of several in one "
        "place the last one counts, and where there is none the object's own material; of a design "
        "or of modes, names of regions that these have, with the material of each, for friction, "
        "bounce, roughness and colour",
    )
    supports: Annotated[tuple[SupportEntry, ...], Within(max_length=1000)] = option(
        (),
        "what holds a fixed mesh, or masses that are fixed to it, in axes whose z points up; those "
        "of modes and designs are in their files",
    )
    unit: MetresPerUnit = option(1.0)
    size: Annotated[float, between(*EXTENTS)] | None = option(
        None, "longest side of a mesh [m], to which it is scaled, in place of a unit"
    )
    up: UpAxis | None = option(
        None,
        "axis of the mesh file that points up, which is turned to the z of the scene, also of a "
        "design or of modes that were made of one; regions and supports are then in the turned "
        "axes; null is what the design or modes were made with, or y of glTF and z of all others",
    )
    pitch: Annotated[float, between(20.0, 20_000.0)] | None = option(
        None, "frequency of its first mode, to which a mesh is scaled [Hz]; null leaves its size"
    )
    resolution: Resolution = option(
        28,
        "lattice spacings, or voxels, along the longest side of a mesh or ball whose modes are "
        "computed [1]; the summary tells how far frequencies are expected to be from the solid's",
    )
    accuracy: Annotated[float, between(1e-4, 1.0)] | None = option(
        0.01,
        "expected relative error of the frequencies down to which finite cells are divided: the "
        "root mean square, and a third of the worst; null divides none",
    )
    discretisation: Annotated[str, OneOf("auto", "finite-cell", "voxel")] = option(
        "auto",
        "how a mesh or ball is discretised, as by `carillon modes`: finite-cell takes walls "
        "thinner than a spacing, voxel makes them as thick as one; auto is finite-cell, or voxel "
        "where finite cells refuse the mesh",
    )
    wall: WallThickness | None = option(None)
    wall_side: WallSide = option("about")
    components: Components = option(
        "error", "what comes of a mesh in several pieces; largest keeps the largest"
    )
    count: Annotated[int, between(0, 1000)] = option(
        40, "elastic modes of a mesh or ball that sound [1]; 0 for a silent one"
    )
    density: Density | None = option(None, "mass density in place of the material's own [kg/m^3]")
    position: Vector = option((0.0, 0.0, 0.0), "where its centre of mass is at the start [m]")
    stands_on: ShownName | None = option(
        None,
        "ground, or the name of another object: the height of its position is the least at which "
        "it lies on that, so z stays 0",
    )
    rotation: Triple[Annotated[float, between(-3600.0, 3600.0)]] = option(
        (0.0, 0.0, 0.0),
        "turns about the axes x, y, z of the scene, one after the other [degrees]",
    )
    velocity: Triple[Annotated[float, between(-100.0, 100.0)]] = option(
        (0.0, 0.0, 0.0), "how fast it moves at the start [m/s]"
    )
    spin: Vector = option(
        (0.0, 0.0, 0.0), "how fast it turns about the axes of the scene at the start [rad/s]"
    )
    fixed: bool = option(
        False,
        "whether it stays where it is; it sounds as a free one does, unless supports hold it",
    )
    friction: Annotated[float, between(0.0, 10.0)] | None = option(
        None,
        "Coulomb's coefficient in place of the material's [1]; of two that touch, the larger one "
        "counts",
    )
    restitution: Annotated[float, between(0.02, 1.0)] | None = option(
        None,
        "share of the speed that a bounce leaves, in place of the material's [1]; of two that "
        "touch, the smaller one counts",
    )
    roughness: Annotated[float, between(0.0, 0.01)] | None = option(
        None,
        "height (rms) of what its surface has beside its shape, in place of the material's [m]",
    )
    damping: Pair[Annotated[float, between(0.0, 1e9)]] | None = option(
        None,
        "Rayleigh's coefficients of mass [1/s] and stiffness [s] in place of the material's; not "
        "of a design",
    )
    collision: Annotated[str, OneOf("parts", "hull")] = option(
        "parts",
        "shape by which it touches others; parts are convex and leave hollows open, hull is one "
        "convex part",
    )
    level: Annotated[float, between(-120.0, 120.0)] = option(
        0.0, "how much louder it is than it would be [dB]"
    )
    colour: Triple[Annotated[float, between(0.0, 1.0)]] | None = option(
        None, "red, green and blue from 0 to 1; those of its material if null"
    )

    def __post_init__(self) -> None:
        given = [key for key in SOURCES if getattr(self, key) is not None]
        if len(given) != 1:
            named = " and ".join(given) or "none of them"
            raise ValueError(f"expected one of {', '.join(SOURCES)}, found {named}")
        (source,) = given
        for key, sources in _SUITS.items():
            default = parameters_of(ObjectEntry)[key].default
            if source not in sources and getattr(self, key) != default:
                raise ValueError(f"{key} goes with {' or '.join(sources)}, found a {source}")
        if self.wall is not None and self.discretisation == "voxel":
            raise ValueError(
                "a wall is of finite cells; take discretisation auto or finite-cell, or leave out "
                "the wall"
            )
        if self.size is not None and self.unit != 1.0:
            raise ValueError("size tells how large the mesh is; leave out the unit")
        if self.size is not None and self.pitch is not None:
            raise ValueError("pitch tells how large the mesh is; leave out the size")
        if self.stands_on is not None and self.position[2] != 0.0:
            raise ValueError(
                f"stands_on tells the height; found a position whose z is {self.position[2]:g}, "
                "expected 0"
            )
        if self.pitch is not None and self.count == 0:
            raise ValueError("pitch goes with a count of modes above 0; what is silent has none")
        if self.material is None and source in ("mesh", "radius") and not self.regions:
            raise ValueError(f"a {source} needs a material; name one")
        self._require_whole(source)

    def _require_whole(self, source: str) -> None:
        """Refuse regions and supports that do not go together with the rest."""
        names = [each.name for each in self.regions]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two regions are called {name!r}; give each a name of its own")
        if source != "mesh":
            for each in self.regions:
                if each != RegionEntry(name=each.name, material=each.material):
                    raise ValueError(
                        f"region {each.name!r}: the {source} tells where it is and how stiff; "
                        "give its name and its material alone"
                    )
        if not self.fixed and any(each.mass is None for each in self.supports):
            raise ValueError("supports hold it, so it cannot move; add fixed: true, or leave them")
        if self.pitch is not None and any(
            each.mass is not None or each.spring is not None or each.pad is not None
            for each in self.supports
        ):
            raise ValueError(
                "pitch scales a mesh, which springs, pads and masses do not follow; leave out "
                "pitch, or hold it without them"
            )

    @property
    def mesh_up(self) -> str | None:
        """Axis of its mesh file that points up; None if neither the scene nor the format says."""
        return self.up or up_of_format(self.mesh or "")

    @property
    def wall_size(self) -> WallSize | None:
        """The wall that a mesh stands for; None if it is what the mesh encloses."""
        return None if self.wall is None else WallSize(self.wall, self.wall_side)

    @cached_property
    def made_of(self) -> NamedMaterial:
        """Its material, with the numbers that the object has in place of the material's."""
        told = self.as_told(self.material or named_material(STANDARD_MATERIAL))
        return told if self.density is None else replace(told, density=self.density)

    def as_told(self, material: NamedMaterial) -> NamedMaterial:
        """A material with what the object says of its surface and damping in place of its own."""
        alpha, beta = self.damping or (material.alpha, material.beta)
        keys = ("friction", "restitution", "roughness", "colour")
        given = {key: getattr(self, key) for key in keys if getattr(self, key) is not None}
        return replace(material, alpha=alpha, beta=beta, **given)


@parameters
class ListenerEntry:
    """Who hears a scene."""

    position: Vector | None = option(
        None, "where the middle of the head is [m]; where the camera is if null"
    )
    facing: Vector | None = option(
        None, "point that the nose is turned to [m]; what the camera looks at if null"
    )
    path: (
        Annotated[
            tuple[tuple[_Coordinate, _Coordinate, _Coordinate, _Coordinate], ...],
            Within(min_length=1, max_length=10_000),
            Check(_in_time),
        ]
        | None
    ) = option(
        None,
        "lines of time [s] and x, y, z [m] that the head moves along, in place of the position",
    )

    def __post_init__(self) -> None:
        if self.path is not None and self.position is not None:
            raise ValueError("expected position or path, found both")


@parameters
class CameraEntry:
    """From where a scene is seen."""

    position: Vector | None = option(None, "where the camera is [m]; a place that sees all if null")
    target: Vector | None = option(None, "what it looks at [m]; the middle of all objects if null")
    degrees: Annotated[float, between(1.0, 170.0)] = option(
        36.0, "vertical field of view [degrees]"
    )


@parameters
class SoundEntry:
    """How a scene sounds."""

    rate: Annotated[int, between(8000, 192_000)] = option(44_100, "samples per second [Hz]")
    full_scale: Annotated[float, between(1e-12, 1e12)] | Literal["auto"] = option(
        "auto",
        "sound pressure of full scale [Pa]; auto lets the loudest sample just reach it, if that is "
        "not below the threshold of hearing (2e-5 Pa)",
    )
    radiation: bool = option(
        True,
        "whether modes and the motion of the whole body are heard as they move the air; without, "
        "modes are as loud as they are struck, as by carillon render",
    )
    space: bool = option(
        True,
        "whether distance and direction are heard; without, all is one metre away, alike in both "
        "ears",
    )
    contact_damping: bool = option(True, "whether what a solid lies on damps it")
    noise: bool = option(True, "whether what clips of designs hold besides modes is heard")


@parameters
class EngineEntry:
    """How contacts are followed in time."""

    contact_seconds: Annotated[float, between(1e-4, 0.02)] = option(
        0.002,
        "how long a bounce takes for the engine [s]; what is heard takes as long as Hertz says",
    )
    steps: Annotated[int, between(8, 200)] = option(16, "steps in that time [1]")

    @property
    def step_seconds(self) -> float:
        """Duration of a step [s]."""
        return self.contact_seconds / self.steps


@parameters
class Scene:
    """Solids that fall, roll and strike each other, where they are heard and seen.

    Once it is loaded, its files hold in the working directory.
    """

    _: KW_ONLY
    title: Annotated[str, Within(min_length=1, max_length=200)] = option(
        "Scene", "what pages call the scene"
    )
    seconds: Annotated[float, between(0.01, 600.0)] = option(5.0, "how long it lasts [s]")
    gravity: Vector = option(
        (0.0, 0.0, -9.81),
        "acceleration of what falls, x, y, z, of which z points up [m/s^2]",
    )
    ground: _Coordinate | None = option(0.0, "height of a floor without end [m]; null for none")
    ground_material: Material = option("concrete", "what the floor is made of, a material by name")
    objects: Annotated[tuple[ObjectEntry, ...], Within(min_length=1, max_length=1000)] = option(
        REQUIRED, "solids of the scene"
    )
    listener: ListenerEntry = option(ListenerEntry, "who hears it")
    camera: CameraEntry = option(CameraEntry, "from where it is seen")
    sound: SoundEntry = option(SoundEntry, "how it sounds")
    engine: EngineEntry = option(EngineEntry, "how contacts are followed in time")
    seed: Annotated[int, between(0, 2**32 - 1)] = option(0, "seed of the roughness of surfaces")

    def __post_init__(self) -> None:
        names = [each.name for each in self.objects]
        for number, name in enumerate(names):
            if name in names[:number]:
                raise ParameterError(
                    ("objects", number, "name"),
                    f"several objects are named {name!r}; give each a name of its own",
                )
        self._require_support()

    def _require_support(self) -> None:
        """Refuse objects that stand on what is not there, or on each other in a circle."""
        below = {each.name: each.stands_on for each in self.objects}
        for number, (name, support) in enumerate(below.items()):
            path = ("objects", number, "stands_on")
            if support == GROUND_NAME and self.ground is None:
                raise ParameterError(path, "there is no ground; give the ground a height")
            if support not in (None, GROUND_NAME, *below):
                raise ParameterError(
                    path,
                    f"found {support!r}, expected {GROUND_NAME} or the name of another object",
                )
            chain = [name]
            while support in below:
                if support in chain:
                    raise ParameterError(
                        path, f"{' on '.join([*chain, support])}: nothing carries them"
                    )
                chain.append(support)
                support = below[support]

    @property
    def files(self) -> list[str]:
        """Files that it is made from."""
        named = [getattr(each, key) for each in self.objects for key in FILES]
        files = [name for name in named if name and not name.startswith(BUILTIN_PREFIX)]
        regions = [region for each in self.objects for region in each.regions]
        return files + [name for region in regions for name in region.files]


def load_scene(path: str | Path) -> Scene:
    """Read a scene file (YAML), but none of the files that it names.

    Raises UserError with one sentence about the first thing that is wrong with it.
    """
    return _in_folder(read_parameters(path, Scene, "a scene"), Path(path).parent)


def scene_of(described: Mapping[str, Any], folder: Path) -> Scene:
    """The scene that the keys and values of a file in `folder` describe.

    Raises UserError with one sentence about the first thing that is wrong.
    """
    return _in_folder(parameters_from(described, Scene), folder)


def _in_folder(scene: Scene, folder: Path) -> Scene:
    """The scene with its files, which are relative to a folder, as the working directory has."""
    objects = []
    for each in scene.objects:
        named = {key: getattr(each, key) for key in FILES}
        files: Any = {key: in_folder(name, folder) for key, name in named.items() if name}
        regions = tuple(region.in_folder(folder) for region in each.regions)
        objects.append(replace(each, **files, regions=regions))
    return replace(scene, objects=tuple(objects))
