"""Regions and supports as people write them: in a file, a project or a call."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np

from carillon.arrays import Surface
from carillon.builtin_names import BUILTIN_PREFIX, in_folder
from carillon.composition.composition import AxesAt, Composition, MaterialRegion, axes_about
from carillon.composition.materials import NamedMaterial, named_material
from carillon.composition.painted import Painted
from carillon.composition.places import (
    Ball,
    Box,
    ClosedSurface,
    Everywhere,
    Expression,
    Labelled,
    Uncovered,
    Where,
)
from carillon.composition.supports import Support
from carillon.errors import UserError
from carillon.fem.elasticity import axes_along, orthotropic_matrix
from carillon.fem.regions import Regions
from carillon.parameters import REQUIRED, OneOf, option, parameters
from carillon.parameters.documents import read_parameters
from carillon.parameters.model import Within
from carillon.parameters.quantities import (
    Density,
    MetresPerUnit,
    NonNegative,
    PoissonRatio,
    Positive,
    ShownName,
    Triple,
    YoungsModulus,
    between,
)

Coordinate = Annotated[float, between(-1e9, 1e9)]
Vector = Triple[Coordinate]
Along = Annotated[str, OneOf("x", "y", "z", "xy", "yz", "xz", "xyz")]
Dab = Annotated[
    tuple[Coordinate, Coordinate, Coordinate, Coordinate],
    "a place of the surface and the radius of the paint there [m]",
]
Paint = Annotated[tuple[Dab, ...], Within(min_length=1, max_length=20_000)]
DEFAULT_YOUNG = 1e9
"""Young's modulus [Pa] of a region that names neither a material nor a modulus."""


@parameters
class RegionEntry:
    """A region of a solid: what it is made of, and where it is."""

    name: ShownName = option(REQUIRED, "what messages and tables call it")
    material: str | None = option(None, "name of its material, such as steel or spruce")
    young: YoungsModulus | None = option(
        None, "Young's modulus in place of the material's; of wood along the grain [Pa]"
    )
    poisson: PoissonRatio | None = option(None, "Poisson's ratio in place of the material's [1]")
    density: Density | None = option(None, "mass density in place of the material's [kg/m^3]")
    loss_factor: Annotated[float, between(0.0, 1.0)] | None = option(
        None, "loss factor at 1 kHz in place of the material's damping [1]"
    )
    grain_young: Triple[YoungsModulus] | None = option(
        None, "Young's moduli along grain, radius and rings of wood, or any three axes [Pa]"
    )
    grain_shear: Triple[YoungsModulus] | None = option(
        None,
        "shear moduli of the first and second of these axes, second and third, third and "
        "first [Pa]",
    )
    grain_poisson: Triple[Annotated[float, between(-10.0, 10.0)]] | None = option(
        None, "Poisson's ratios of the same pairs: across by the second, stress along the first [1]"
    )
    grain: Vector | None = option(None, "direction of the grain, the first axis (x unless given)")
    radial: Vector | None = option(None, "direction across it, the second axis")
    pith: Vector | None = option(
        None, "a point of the pith of the tree [m]: the radius leads away from it at every place"
    )
    where: str | None = option(
        None, "comparisons of x, y and z [m] that hold in the region, such as z < 0.01"
    )
    box: tuple[Vector, Vector] | None = option(None, "lowest and highest corner of a box [m]")
    mesh: str | None = option(None, "file of a closed surface around it, relative to this file")
    part: str | None = option(
        None, "name of a part of the solid's mesh (glTF, OBJ, 3MF), or of that file"
    )
    labels: str | None = option(
        None, "file that labels the solid's parts (.msh, .vtu, .vti, .npy), relative to this file"
    )
    label: Annotated[str, Within(min_length=1, max_length=100)] | None = option(
        None, "name or number of its label in that file"
    )
    unit: MetresPerUnit = option(
        1.0, "unit of its mesh or labels: m, cm, mm, um or in, or a number [m]"
    )
    painted: Paint | None = option(
        None,
        "places of the surface, x, y, z, and the radius about each that is painted [m]: what is "
        "nearest to that is in the region; a negative radius takes paint away, the last one counts",
    )
    depth: Positive | None = option(
        None,
        "how deep the paint goes below its side [m]; if null, through thin walls, and else to "
        "where another side is nearer",
    )

    def __post_init__(self) -> None:
        kinds = ("where", "box", "mesh", "labels", "painted")
        places = [name for name in kinds if getattr(self, name) is not None]
        if self.depth is not None and self.painted is None:
            raise ValueError("depth goes with painted")
        if len(places) > 1:
            raise ValueError(f"expected one place, found {' and '.join(places)}")
        if self.part is not None and places and places != ["mesh"]:
            raise ValueError(f"expected one place, found part and {places[0]}")
        if (self.labels is None) != (self.label is None):
            raise ValueError("labels and label go together")
        given = [self.grain_young, self.grain_shear, self.grain_poisson]
        if any(each is not None for each in given) and None in given:
            raise ValueError("grain_young, grain_shear and grain_poisson go together")
        if self.radial is not None and self.pith is not None:
            raise ValueError("expected radial or pith, found both")

    @property
    def files(self) -> list[str]:
        """Files that it names; built-in solids are none."""
        named = (self.mesh, self.labels)
        return [name for name in named if name and not name.startswith(BUILTIN_PREFIX)]

    def in_folder(self, folder: Path) -> RegionEntry:
        """The region with the paths of its files, relative to a folder, seen from the working
        directory."""
        named = {"mesh": self.mesh, "labels": self.labels}
        there = {key: in_folder(name, folder) for key, name in named.items() if name}
        return replace(self, **there)  # type: ignore[arg-type]

    @property
    def _material(self) -> NamedMaterial | None:
        return None if self.material is None else named_material(self.material)

    def row(self) -> Regions:
        """Its row in the table of regions.

        Raises UserError for a material that there is not, or constants that no material has.
        """
        material = self._material
        damping = None if material is None else (material.alpha, material.beta)
        if self.loss_factor is not None:
            omega = 2.0 * np.pi * 1000.0
            damping = 0.5 * self.loss_factor * omega, 0.5 * self.loss_factor / omega
        density = self.density or (1000.0 if material is None else material.density)
        try:
            if self.grain_young is not None:
                triples = self.grain_young, self.grain_shear, self.grain_poisson
                matrix = orthotropic_matrix(*(np.array(triple) for triple in triples))
                return Regions.anisotropic(matrix, density, damping, self.name)
            if material is not None and material.is_wood:
                if self.poisson is not None:
                    raise UserError(
                        f"{self.material} has several Poisson's ratios; leave poisson out or give "
                        "grain_young, grain_shear and grain_poisson"
                    )
                row = material.region(self.name, density)
                # The modulus along the grain; the others keep their ratios to it.
                along = row.young if self.young is None else np.array([float(self.young)])
                return replace(row, young=along, damping=(damping,))
            if material is None and self.young is None:
                raise UserError("found neither material nor young; name what it is made of")
            young = self.young or (DEFAULT_YOUNG if material is None else material.young)
            poisson = self.poisson
            if poisson is None:
                poisson = 0.25 if material is None else material.poisson
            return Regions.one(poisson, density, young, damping, self.name)
        except UserError as error:
            raise UserError(f"region {self.name!r}: {error}") from None

    def domain(self, solid: SolidFrame) -> Where:
        """Where it is in a solid."""
        if self.where is not None:
            return Expression(self.where)
        if self.box is not None:
            low, high = (np.array(corner) for corner in self.box)
            if not (low < high).all():
                raise UserError(
                    f"region {self.name!r}: the box from {list(low)} to {list(high)} is empty; "
                    "expected its lowest and highest corner"
                )
            return Box(low, high)
        if self.labels is not None and self.label is not None:
            return _labelled(in_folder(self.labels, solid.folder), self.label, self.unit, solid)
        if self.mesh is not None:
            own = self.own_surface(solid.folder, solid.up)
            return ClosedSurface(_closed(own, self.name))
        if self.part is not None:
            part = _part(solid.mesh, self.part, solid.unit, self.name, solid.up)
            return ClosedSurface(_closed(part, self.name))
        if self.painted is not None:
            return Painted(solid.surface, self.painted, self.depth)
        return Everywhere()

    def own_surface(self, folder: Path, up: str | None = None) -> Surface:
        """The closed surface in its mesh file, relative to a folder, whose axis `up` points up."""
        from carillon.fem.geometry import load_surface  # Its import takes long.

        assert self.mesh is not None
        path = in_folder(self.mesh, folder)
        if self.part is not None:
            return _part(path, self.part, self.unit, self.name, up)
        return load_surface(path, self.unit, up=up)

    def axes(self) -> np.ndarray | AxesAt | None:
        """Axes of the material, or where they lie at each place."""
        if self.grain is None and self.radial is None and self.pith is None:
            return None
        grain = np.array(self.grain or (1.0, 0.0, 0.0), dtype=float)
        source = f"region {self.name!r}"
        if self.pith is not None:
            axes_along(grain, source=source)
            return axes_about(grain, np.array(self.pith, dtype=float))
        radial = None if self.radial is None else np.array(self.radial, dtype=float)
        return axes_along(grain, radial, source)


@parameters
class SupportEntry:
    """A support as files have it: a held place, a pad, springs, or a mass fixed to the solid."""

    where: str | None = option(
        None, "comparisons of x, y and z [m] that hold there, such as z < 0.01; or region:NAME"
    )
    at: Vector | None = option(None, "a point of the solid [m]")
    radius: Positive | None = option(None, "distance from the point within which all is held [m]")
    painted: Paint | None = option(
        None,
        "places of the surface, x, y, z, and the radius about each that is held there [m]; a "
        "negative radius takes away, the last one counts",
    )
    along: Along = option("xyz", "axes along which it acts")
    spring: NonNegative | None = option(
        None,
        "stiffness of springs there: of each point [N/m], or by area of surface [N/m^3]; held "
        "if null",
    )
    pad: str | None = option(None, "name of the material of a pad that it rests on")
    thickness: Positive | None = option(None, "thickness of the pad [m]")
    mass: Positive | None = option(
        None, "mass that is fixed to the point, or to all within the radius [kg]"
    )

    def __post_init__(self) -> None:
        if [self.where, self.at, self.painted].count(None) != 2:
            raise ValueError("expected where, at or painted")
        if (self.pad is None) != (self.thickness is None):
            raise ValueError("pad and thickness go together")
        if self.mass is not None and (self.at is None or self.spring is not None):
            raise ValueError("mass goes with a point, and without a spring")
        if self.pad is not None and self.spring is not None:
            raise ValueError("expected spring or pad, found both")
        if self.pad is not None and self.at is not None and self.radius is None:
            raise ValueError("pad goes with where, or with a radius about a point")
        if self.radius is not None and self.at is None:
            raise ValueError("radius goes with at")

    @property
    def label(self) -> str:
        """Name of the support in messages: its place."""
        if self.painted is not None:
            x, y, z, _ = self.painted[0]
            return f"support painted at {[x, y, z]}"
        return f"support {self.where!r}" if self.at is None else f"support at {list(self.at)}"

    def support(self, regions: Mapping[str, Where], surface: Surface) -> Support:
        """The support of the solid inside a surface, whose `regions` have names.

        Raises UserError for a region or a material that there is not.
        """
        axes = "x" in self.along, "y" in self.along, "z" in self.along
        pad = None
        if self.pad is not None and self.thickness is not None:
            material = named_material(self.pad)
            across = material.young / self.thickness
            pad = across, across / (2.0 * (1.0 + material.poisson))
        spring = None if self.spring is None else np.array(self.spring)
        if self.at is not None and self.radius is None:
            point = (float(self.at[0]), float(self.at[1]), float(self.at[2]))
            return Support(self.label, None, point, axes, spring, self.mass or 0.0)
        place, mass = self._domain(regions, surface), self.mass or 0.0
        return Support(self.label, place, None, axes, spring, mass, pad)

    def _domain(self, regions: Mapping[str, Where], surface: Surface) -> Where:
        if self.painted is not None:
            return Painted(surface, self.painted, depth=0.0)
        if self.at is not None and self.radius is not None:
            return Ball(np.array(self.at, dtype=float), self.radius)
        assert self.where is not None
        if not self.where.startswith("region:"):
            return Expression(self.where)
        name = self.where.removeprefix("region:")
        if name not in regions:
            known = ", ".join(map(repr, regions)) or "none"
            raise UserError(f"support: there is no region {name!r}; the solid has {known}")
        return regions[name]


@parameters
class CompositionEntry:
    """Regions and supports of a solid, as files have them."""

    regions: Annotated[tuple[RegionEntry, ...], Within(max_length=1000)] = option(
        (), "regions in their order: of several in one place the last one counts"
    )
    supports: Annotated[tuple[SupportEntry, ...], Within(max_length=1000)] = option(
        (), "what holds the solid"
    )

    def __post_init__(self) -> None:
        names = [entry.name for entry in self.regions]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two regions are called {name!r}; give each a name of its own")

    @property
    def is_isotropic(self) -> bool:
        """Whether no region is of wood, or has axes otherwise.

        Raises UserError as `RegionEntry.row` does.
        """
        return all(each.row().is_isotropic for each in self.regions)


def _part(path: str, name: str, unit: float, region: str, up: str | None) -> Surface:
    """All parts of that name together."""
    from carillon.fem.geometry.parts import named_surfaces

    parts = named_surfaces(path, unit, up)
    own = [surface for each, surface in parts if each == name]
    if not own:
        known = ", ".join(sorted({each for each, _ in parts}))
        raise UserError(f"region {region!r}: {path} has no part {name!r}, only {known}")
    return own[0] if len(own) == 1 else _joined(own)


def _labelled(path: str, label: str, unit: float, solid: SolidFrame) -> Where:
    from carillon.fem.geometry.labels import read_labels

    labels = read_labels(path, unit, box=np.asarray(solid.surface.bounds), up=solid.up)
    numbers = [number for number, name in labels.names.items() if name == label]
    if not numbers and label.isdigit() and int(label) in labels.names:
        numbers = [int(label)]
    if not numbers:
        raise UserError(f"{path}: has no label {label!r}, only {', '.join(labels.names.values())}")
    return Labelled(labels, tuple(numbers))


@dataclass(frozen=True)
class SolidFrame:
    """The solid that regions and supports are of."""

    mesh: str
    """Path of its mesh, or `builtin:NAME`."""
    surface: Surface
    """Triangles around it [m]."""
    name: str
    unit: float = 1.0
    """Metres per unit of the mesh."""
    folder: Path = Path()
    """That files of entries are relative to."""
    up: str | None = None
    """Axis that points up in its mesh and in all files of entries, see `UpAxis`."""


@dataclass(frozen=True)
class Placed:
    """Regions and supports with their places."""

    composition: Composition | None
    supports: tuple[Support, ...]


def describes_regions(path: str) -> bool:
    """Whether a solid is given by a file of regions in place of a mesh."""
    return Path(path).suffix.lower() in (".yaml", ".yml")


def read_composition(path: str | Path) -> CompositionEntry:
    """Read regions and supports from a YAML file.

    Raises UserError with the line and one sentence about the first thing that is wrong.
    """
    return read_parameters(path, CompositionEntry, "regions and supports of a solid")


def compose(
    entry: CompositionEntry,
    solid: SolidFrame,
    fixed: Sequence[str] = (),
    rest: Regions | None = None,
) -> Placed:
    """Regions and supports of a solid.

    Further places are `fixed`, held there, see `SupportEntry.where`; `rest` is the row of what is
    of no region, without which there must be nothing such. Raises UserError for files, materials
    and places that are of no use.
    """
    composition, seen = None, dict[str, Where]()
    parts = [_material_region(each, solid) for each in entry.regions]
    if rest is not None:
        parts.insert(0, MaterialRegion(rest, Everywhere()))
    if parts:
        inside = ClosedSurface(solid.surface)
        composition = Composition(parts, solid.name, inside, rest is not None)
        placement, first = composition.placement, len(parts) - len(entry.regions)
        seen = {
            each.name: Uncovered(placement, number)
            for number, each in enumerate(entry.regions, first)
        }
    entries = [*entry.supports, *(SupportEntry(where=where) for where in fixed)]
    return Placed(composition, tuple(each.support(seen, solid.surface) for each in entries))


def _material_region(entry: RegionEntry, solid: SolidFrame) -> MaterialRegion:
    row = entry.row()
    # The axes of what is the same in all directions are no matter.
    axes = None if row.is_isotropic else entry.axes()
    return MaterialRegion(row, entry.domain(solid), axes)


def _closed(surface: Surface, region: str) -> Surface:
    """A surface that is closed, once equal vertices are one; raises UserError for others."""
    merged = type(surface)(surface.vertices, surface.faces, process=False)
    merged.merge_vertices(merge_tex=True, merge_norm=True)
    if not merged.is_watertight:
        raise UserError(
            f"region {region!r}: its surface is not closed, so that it has no inside; close the "
            "holes of the mesh"
        )
    return surface


def joined_surface(entry: CompositionEntry, path: str, up: str | None = None) -> Surface:
    """The surface around all regions of a file, each of which is a closed surface.

    The axis `up` of their meshes points up.

    Raises UserError if one is not, or there are none.
    """
    folder = Path(path).parent
    surfaces: list[Surface] = []
    for each in entry.regions:
        if each.mesh is None:
            raise UserError(
                f"{path}: region {each.name!r} has no mesh; a solid made of its regions needs one "
                "of each, or name the solid's own mesh and --regions"
            )
        surfaces.append(each.own_surface(folder, up))
    if not surfaces:
        raise UserError(f"{path}: has no regions; expected some with a mesh each")
    return _joined(surfaces)


def _joined(surfaces: list[Surface]) -> Surface:
    vertices = np.concatenate([np.asarray(each.vertices) for each in surfaces])
    first = np.cumsum([0, *(len(each.vertices) for each in surfaces)])
    faces = [np.asarray(each.faces) + start for each, start in zip(surfaces, first)]
    return type(surfaces[0])(vertices, np.concatenate(faces), process=False)
