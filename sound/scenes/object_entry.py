"""An object of a scene: what solid it is, where it is, and how it begins to move."""

from dataclasses import replace
from functools import cached_property
from typing import Annotated, Any

from carillon.composition.entries import RegionEntry, SupportEntry
from carillon.composition.materials import NamedMaterial, named_material
from carillon.errors import UserError
from carillon.fem.geometry.turning import up_of_format
from carillon.fem.geometry.walls import WallSize
from carillon.limits import EXTENTS
from carillon.parameters import REQUIRED, Check, OneOf, Within, option, parameters
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

SOURCES = ("design", "modes", "mesh", "radius")
"""What an object may be, one of them."""
FILES = ("design", "modes", "mesh", "heard_modes")
"""Keys of an object that name files."""
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

Coordinate = Annotated[float, between(-1000.0, 1000.0)]
"""A coordinate [m], or a component of a vector."""
Vector = Triple[Coordinate]


def _material(name: Any) -> Any:
    if not isinstance(name, str):
        return name
    try:
        return named_material(name)
    except UserError as error:
        raise ValueError(str(error)) from None


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
