"""The solid of a scene's object: of a design, a modes file, a mesh or a ball."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Integers, Surface
from carillon.command_line.progress import say
from carillon.composition.materials import NamedMaterial
from carillon.errors import UserError
from carillon.fem.geometry.hints import MeshHints
from carillon.fem.geometry.turning import remaining_turn
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
from sound.scenes.object_entry import ObjectEntry
from sound.scenes.solved import Discretised, SolvedSolid, scaled_rigid
from sound.scenes.touched import touched_in_file, young_near
from sound.scenes.uniform import DENSITY, UniformSolid, scaled

BALL_DIVISIONS = 3
"""Number of times that the faces of an icosahedron are divided to make the surface of a ball."""


@dataclass(frozen=True)
class Sounding:
    """How an object sounds.

    Attributes
    ----------
    solid, listening
        Modes as they are struck; loudness and noise of a design's clips, None without.
    accuracy
        Expected errors of the frequencies, see `sound.scenes.solved.SolvedSolid`; None if they are
        unknown.
    """

    solid: SoundingSolid
    listening: Listening | None = None
    accuracy: dict[str, Any] | None = None


@dataclass(frozen=True)
class ObjectSolid:
    """The solid of an object, in the coordinates of its file, or of its mesh turned upright."""

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
    volume: float
    """float [m^3]: volume of the material."""
    find: Callable[[], Sounding] | None
    """Finds the modes, which may take long; None if the object is silent. Raises ConvergenceError
    if they were not found."""
    turn: Array | None = None
    """(3, 3) or None: rotation from these coordinates to axes whose z points up, see
    `carillon.fem.geometry.turning.remaining_turn`."""
    radius: float | None = None
    """float [m] or None: radius of a ball, None for any other solid."""
    is_held: bool = False
    """bool: whether something holds it in its place."""


def object_solid(entry: ObjectEntry) -> ObjectSolid:
    """The solid that an entry of a scene describes, whose modes are found later.

    Those of an object with a pitch are found at once, since they tell its size.  Raises UserError
    if a file is missing or unusable, or a solid cannot be made, and ConvergenceError if such modes
    were not found.
    """
    if entry.design is not None:
        return _of_design(entry, entry.design)
    if entry.modes is not None:
        return _of_modes(entry, entry.modes, entry.heard_modes)
    if entry.radius is not None:
        return _of_ball(entry, entry.radius)
    mesh = entry.mesh
    assert mesh is not None
    in_metres = entry if entry.size is None else _in_metres(entry, mesh, entry.size)
    made = (_of_parts if entry.regions or entry.supports else _of_mesh)(in_metres, mesh)
    _say_hints(entry, mesh, made)
    return made


def _say_hints(entry: ObjectEntry, mesh: str, solid: ObjectSolid) -> None:
    """Log what may be otherwise than the mesh was opened; its unit, where that tells its size."""
    import trimesh

    surface = trimesh.Trimesh(solid.vertices, solid.faces, process=False)
    is_wall = entry.wall is not None
    hints = MeshHints.of(mesh, surface, entry.unit, entry.mesh_up, is_wall)
    hints = replace(hints, owner=entry.name)
    if entry.size is not None or entry.pitch is not None:
        hints = replace(hints, units={})
    hints.say(for_file=True)


def _in_metres(entry: ObjectEntry, mesh: str, size: float) -> ObjectEntry:
    """The entry with the unit at which the longest side of its mesh is a size [m]."""
    longest = max(SolidSurface.read(mesh).extents)
    if not longest > 0.0:
        raise UserError(f"{mesh}: has no size, so it cannot be scaled; name another mesh")
    return replace(entry, unit=size / longest, size=None)


def _of_design(entry: ObjectEntry, path: str) -> ObjectSolid:
    design = read_design(_of_kind(path, "design"))
    sounding = SoundingSolid.of_design(design)
    if design.place is not None:
        at = ", ".join(f"{each:g}" for each in design.place.at)
        say(
            f"{entry.name!r} is designed for a listener towards ({at}) m in the axes of its mesh, "
            "and sounds otherwise elsewhere"
        )
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
        _volume(design.model),
        lambda: Sounding(replace(sounding, heard=None), Listening.of_design(design, sounding)),
        design.remaining_turn(entry.up),
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
    sounding = _heard(entry, heard)
    return ObjectSolid(
        mass_properties(file.model),
        vertices,
        faces,
        touched.share * young_near(file.model, vertices),
        touched.poisson,
        touched.materials,
        touched.which,
        _volume(file.model),
        lambda: Sounding(sounding, accuracy=accuracy or None),
        remaining_turn(file.attributes.get("mesh", ""), entry.up, file.up),
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


def _volume(model: Solid) -> float:
    return float(model.mass / model.density)


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
    find = None
    if entry.count:
        ball = _Scaled(sphere.copy(), entry, radius)
        radius *= ball.factor
        find = ball.sounding
    sphere.apply_scale(radius)
    volume = 4.0 / 3.0 * np.pi * radius**3
    mass = volume * entry.made_of.density
    moments = np.full(3, 0.4 * mass * radius**2)
    rigid = MassProperties(mass, np.zeros(3), moments, np.eye(3))
    return _of_one_material(entry, rigid, sphere, volume, find, radius)


def _of_mesh(entry: ObjectEntry, mesh: str) -> ObjectSolid:
    from sound.strikes import longest_side, struck_surface

    wall = entry.wall_size
    surface = struck_surface(mesh, entry.unit, wall=wall, up=entry.mesh_up)
    # In the mesh's own unit, so that objects which differ by unit alone share their modes.
    longest = longest_side(surface) / entry.unit
    unit = 1.0 if EXTENTS[0] <= longest <= EXTENTS[1] else entry.unit
    size = entry.unit / unit
    if wall is not None:
        wall = WallSize(wall.thickness / size, wall.side)
    solid = _Scaled(SolidSurface.read(mesh, unit, wall, entry.mesh_up).solid, entry, size)
    rigid = solid.rigid
    surface.apply_scale(solid.factor)
    volume = rigid.mass / entry.made_of.density
    return _of_one_material(entry, rigid, surface, volume, solid.sounding if entry.count else None)


def _of_one_material(
    entry: ObjectEntry,
    rigid: MassProperties,
    surface: Surface,
    volume: float,
    find: Callable[[], Sounding] | None,
    radius: float | None = None,
) -> ObjectSolid:
    """The solid inside a surface, of the object's own material."""
    material = entry.made_of
    return ObjectSolid(
        rigid,
        np.asarray(surface.vertices),
        np.asarray(surface.faces),
        np.full(len(surface.vertices), material.young),
        material.poisson,
        (material,),
        None,
        volume,
        find,
        radius=radius,
    )


def _of_parts(entry: ObjectEntry, mesh: str) -> ObjectSolid:
    """The solid of a mesh of several regions, or that something holds."""
    from sound.strikes import struck_surface

    up = entry.mesh_up
    given = SolidSurface.read(mesh, entry.unit, entry.wall_size, up)
    composed = ComposedObject(entry, given)
    surface = struck_surface(mesh, entry.unit, composed.parts_of, entry.wall_size, up)
    vertices, faces = np.asarray(surface.vertices), np.asarray(surface.faces)
    which = composed.parts_of(vertices, faces)
    unsolved = composed.unsolved(_how(entry))
    rigid, model = unsolved.rigid, unsolved.model
    find, factor = partial(_found, partial(composed.solved, unsolved)), 1.0
    if entry.pitch is not None:
        solved = composed.solved(unsolved)
        factor = solved.factor_to(entry.pitch)
        rigid = scaled_rigid(rigid, factor)
        find = partial(_found, partial(solved.resized, factor))
    of_parts = composed.materials
    young, poisson = np.array([(each.young, each.poisson) for each in of_parts])[which].T
    return ObjectSolid(
        rigid,
        factor * vertices,
        faces,
        young,
        poisson,
        of_parts,
        which,
        factor**3 * _volume(model),
        find if entry.count else None,
        is_held=model.rigid_modes < RIGID_MODES,
    )


def _found(solved: Callable[[], SolvedSolid]) -> Sounding:
    solid = solved()
    return Sounding(solid.sounding(), accuracy=solid.accuracy)


def _how(entry: ObjectEntry) -> Discretised:
    return Discretised(
        entry.discretisation, entry.resolution, entry.components, entry.count, entry.accuracy
    )


class _Scaled:
    """The uniform solid of a surface, enlarged by a size, and by a factor that gives it a pitch."""

    def __init__(self, surface: Surface | Wall, entry: ObjectEntry, size: float) -> None:
        self._material, self._damping = entry.made_of, _damping(entry)
        self._solid = UniformSolid(surface, entry.name, _how(entry), self._material.poisson)
        self.factor = 1.0
        if entry.pitch is not None:
            self.factor = self._solved(size).factor_to(entry.pitch)
        self._size = self.factor * size

    @property
    def rigid(self) -> MassProperties:
        """Mass, centre of mass and inertia."""
        return scaled_rigid(self._solid.rigid, self._size, self._material.density / DENSITY)

    def sounding(self) -> Sounding:
        """The modes; raises ConvergenceError if they were not found."""
        solid = self._solved(self._size)
        return Sounding(solid.sounding(self._damping), accuracy=solid.accuracy)

    def _solved(self, size: float) -> SolvedSolid:
        return scaled(self._solid.solved, size, self._material.young, self._material.density)


def _damping(entry: ObjectEntry) -> Damping:
    return Damping(entry.made_of.alpha, entry.made_of.beta)
