"""The solid of a scene's object: of a design, a modes file, a mesh or a ball."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Integers, Surface
from carillon.composition.materials import NamedMaterial
from carillon.errors import UserError
from carillon.fem.geometry.size import doubt_unit
from carillon.fem.geometry.walls import Wall, WallSize
from carillon.fem.model import RIGID_MODES, MassProperties, Solid, mass_properties
from carillon.files.hdf5 import kind_of
from carillon.limits import EXTENTS
from solver.analysis.solid_surface import SolidSurface
from solver.files.modes_file import ModesFile, read_modes, require_same_solid
from solver.refinement.errors import FROM_SOLID
from solver.response.response import Damping
from sound.project.design_file import read_design
from sound.rendering.listening import Listening
from sound.rendering.solid import SoundingSolid
from sound.scenes.composed import ComposedObject, losing
from sound.scenes.scene import ObjectEntry
from sound.scenes.solved import Discretised
from sound.scenes.touched import touched_in_file, young_near
from sound.scenes.uniform import UniformSolid, uniform_solid

BALL_DIVISIONS = 3
"""Number of times that the faces of an icosahedron are divided to make the surface of a ball."""


@dataclass(frozen=True)
class ObjectSolid:
    """The solid of an object, in the coordinates of its file.

    Attributes
    ----------
    sounding, listening
        Modes, None if the object is silent; loudness and noise of a design's clips, None without.
    """

    rigid: MassProperties
    """Mass, centre of mass and inertia."""
    vertices: Array
    faces: NDArray[np.integer]
    young: Array
    poisson: Array | float
    """(V, 3) [m], (F, 3), (V,) [Pa], (V,) or float: surface, Young's modulus at its vertices, and
    Poisson's ratio."""
    materials: tuple[NamedMaterial, ...]
    which: Integers | None
    """What it is made of as others touch it, and number (V,) of that at each vertex; None if there
    is one."""
    sounding: SoundingSolid | None
    mesh: str = ""
    """str: name of the mesh file whose axes the solid has, empty if there is none."""
    listening: Listening | None = None
    radius: float | None = None
    """float [m] or None: radius of a ball, None for any other solid."""
    accuracy: dict[str, Any] | None = None
    """dict or None: expected errors of the frequencies, see `sound.scenes.solved.SolvedSolid`."""
    volume: float | None = None
    """float [m^3] or None: volume of the material; None if the object's density tells it."""
    is_held: bool = False
    """bool: whether something holds it in its place."""


def object_solid(entry: ObjectEntry) -> ObjectSolid:
    """The solid that an entry of a scene describes.

    Raises UserError if a file is missing or unusable, or a solid cannot be made, and
    ConvergenceError if the modes were not found.
    """
    if entry.design is not None:
        return _of_design(entry, entry.design)
    if entry.modes is not None:
        return _of_modes(entry, entry.modes, entry.heard_modes)
    if entry.radius is not None:
        return _of_ball(entry, entry.radius)
    assert entry.mesh is not None
    if entry.regions or entry.supports:
        return _of_parts(entry, entry.mesh)
    return _of_mesh(entry, entry.mesh)


def _of_design(entry: ObjectEntry, path: str) -> ObjectSolid:
    design = read_design(_of_kind(path, "design"))
    sounding = SoundingSolid.of_design(design)
    vertices = design.surface_vertices
    touched = touched_in_file(entry, path, design.model, vertices)
    return ObjectSolid(
        mass_properties(design.model),
        vertices,
        design.surface_faces,
        touched.share * design.young_near(vertices),
        touched.poisson,
        touched.materials,
        touched.which,
        sounding,
        _file_axes(design.settings),
        Listening.of_design(design, sounding),
        volume=_volume(design.model),
        is_held=design.model.rigid_modes < RIGID_MODES,
    )


def _of_modes(entry: ObjectEntry, path: str, heard_path: str | None) -> ObjectSolid:
    """The solid of a modes file, with the modes of another file if one is named."""
    heard = file = read_modes(_of_kind(path, "modes"))
    if heard_path is not None:
        heard = read_modes(_of_kind(heard_path, "modes"))
        require_same_solid((path, heard_path), (file, heard))
    vertices, faces = _voxel_surface(file.model)
    attributes = heard.attributes
    accuracy = {key: value for key, value in attributes.items() if key.startswith(FROM_SOLID)}
    if accuracy:
        kept = ("discretisation", "resolution")
        accuracy |= {key: attributes[key] for key in kept if key in attributes}
    touched = touched_in_file(entry, path, file.model, vertices)
    return ObjectSolid(
        mass_properties(file.model),
        vertices,
        faces,
        touched.share * young_near(file.model, vertices),
        touched.poisson,
        touched.materials,
        touched.which,
        _heard(entry, heard),
        _file_axes(file.attributes),
        accuracy=accuracy or None,
        volume=_volume(file.model),
        is_held=file.model.rigid_modes < RIGID_MODES,
    )


def _heard(entry: ObjectEntry, file: ModesFile) -> SoundingSolid:
    """Modes of a file, damped as its regions, where it tells, or as the object says."""
    regions, own = file.model.regions, entry.made_of
    told = file.model.region is not None or entry.material is None
    if entry.damping is not None or not told or not any(regions.damping):
        return SoundingSolid.of_modes(file, _damping(entry))
    assert file.modes is not None
    by_name = {
        name: damping or (own.alpha, own.beta)
        for name, damping in zip(regions.names, regions.damping)
    }
    return SoundingSolid.damped(losing(file.model, by_name), file.eigenvalues, file.modes)


def _volume(model: Solid) -> float | None:
    return None if model.region is None and model.supports is None else model.mass / model.density


def _file_axes(described: Mapping[str, Any]) -> str:
    """Name of the mesh file whose axes a design or a modes file has; empty if they were turned."""
    return "" if described.get("up") else described.get("mesh", "")


def _of_kind(path: str, expected: str) -> str:
    kind = kind_of(path, f"a Carillon {expected} file (HDF5)")[0]
    if not kind:
        raise UserError(f"{path}: is no file of Carillon, expected {expected}; name a mesh by mesh")
    if kind != expected:
        raise UserError(f"{path}: is a file of kind {kind}, expected {expected}; name it by {kind}")
    return path


def _voxel_surface(model: Solid) -> tuple[Array, NDArray[np.int64]]:
    from carillon.fem.geometry.faces import surface_quads

    quads = surface_quads(model.mesh)
    used, numbers = np.unique(quads, return_inverse=True)
    corners = numbers.reshape(-1, 4)
    faces = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    return model.mesh.nodes[used], faces.astype(np.int64)


def _of_ball(entry: ObjectEntry, radius: float) -> ObjectSolid:
    import trimesh

    sphere = trimesh.creation.icosphere(BALL_DIVISIONS, 1.0)
    sounding, accuracy = None, None
    if entry.count:
        ball, factor = _uniform(sphere, entry, radius)
        radius *= factor
        sounding, accuracy = ball.sounding(_damping(entry)), ball.accuracy
    sphere.apply_scale(radius)
    mass = 4.0 / 3.0 * np.pi * radius**3 * entry.made_of.density
    moments = np.full(3, 0.4 * mass * radius**2)
    rigid = MassProperties(mass, np.zeros(3), moments, np.eye(3))
    return ObjectSolid(
        rigid,
        np.asarray(sphere.vertices),
        np.asarray(sphere.faces),
        np.full(len(sphere.vertices), entry.made_of.young),
        entry.made_of.poisson,
        (entry.made_of,),
        None,
        sounding,
        radius=radius,
        accuracy=accuracy,
    )


def _of_mesh(entry: ObjectEntry, mesh: str) -> ObjectSolid:
    from sound.strikes import longest_side, struck_surface

    wall = entry.wall_size
    surface = struck_surface(mesh, entry.unit, wall=wall)
    # In the mesh's own unit, so that objects which differ by unit alone share their modes.
    longest = longest_side(surface) / entry.unit
    unit = 1.0 if EXTENTS[0] <= longest <= EXTENTS[1] else entry.unit
    size = entry.unit / unit
    if wall is not None:
        wall = WallSize(wall.thickness / size, wall.side)
    solid, factor = _uniform(SolidSurface.read(mesh, unit, wall).solid, entry, size)
    doubt_unit(mesh, surface.extents, entry.unit)
    surface.apply_scale(factor)
    return ObjectSolid(
        mass_properties(solid.model),
        np.asarray(surface.vertices),
        np.asarray(surface.faces),
        np.full(len(surface.vertices), entry.made_of.young),
        entry.made_of.poisson,
        (entry.made_of,),
        None,
        solid.sounding(_damping(entry)),
        mesh,
        accuracy=solid.accuracy if entry.count else None,
    )


def _of_parts(entry: ObjectEntry, mesh: str) -> ObjectSolid:
    """The solid of a mesh of several regions, or that something holds."""
    from sound.strikes import struck_surface

    given = SolidSurface.read(mesh, entry.unit, entry.wall_size)
    composed = ComposedObject(entry, given)
    surface = struck_surface(mesh, entry.unit, composed.parts_of, entry.wall_size)
    vertices, faces = np.asarray(surface.vertices), np.asarray(surface.faces)
    which = composed.parts_of(vertices, faces)
    solid = composed.solid(_how(entry))
    doubt_unit(mesh, surface.extents, entry.unit)
    factor = 1.0
    if entry.pitch is not None:
        factor = solid.factor_to(entry.pitch)
        solid = solid.resized(factor)
    of_parts = composed.materials
    young, poisson = np.array([(each.young, each.poisson) for each in of_parts])[which].T
    return ObjectSolid(
        mass_properties(solid.model),
        factor * vertices,
        faces,
        young,
        poisson,
        of_parts,
        which,
        solid.sounding(),
        mesh,
        accuracy=solid.accuracy if entry.count else None,
        volume=_volume(solid.model),
        is_held=solid.model.rigid_modes < RIGID_MODES,
    )


def _how(entry: ObjectEntry) -> Discretised:
    return Discretised(entry.discretisation, entry.resolution, entry.components, entry.count)


def _uniform(
    surface: Surface | Wall, entry: ObjectEntry, size: float
) -> tuple[UniformSolid, float]:
    """The solid of a surface of size 1, at a size; and the factor of the entry's pitch."""
    material = entry.made_of
    solid = uniform_solid(surface, entry.name, _how(entry), material.poisson)
    return solid.sized(size, material.young, material.density, entry.pitch)


def _damping(entry: ObjectEntry) -> Damping:
    return Damping(entry.made_of.alpha, entry.made_of.beta)
