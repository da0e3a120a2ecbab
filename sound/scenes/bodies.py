"""An object of a scene: a rigid body with a surface that gives way and modes that sound."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.errors import ConvergenceError, UserError
from carillon.fem.geometry.size import doubt_unit
from carillon.fem.model import RIGID_MODES, Solid
from carillon.fem.rigid import MassProperties, mass_properties
from carillon.files.hdf5 import kind_of
from carillon.limits import EXTENTS
from solver.files.modes_file import read_modes, require_same_solid
from solver.refinement.errors import FROM_SOLID
from solver.response.response import Damping
from sound.project.design import Design
from sound.project.design_file import read_design
from sound.rendering.listening import Listening
from sound.rendering.solid import SoundingSolid
from sound.scenes.axes import upright
from sound.scenes.convex import convex_parts, hull_of
from sound.scenes.hertz import compliance
from sound.scenes.scene import ObjectEntry
from sound.scenes.shape import Shape
from sound.scenes.uniform import Discretised, UniformSolid, uniform_solid

Array = NDArray[np.float64]

LIGHTEST = 1e-9
"""Mass [kg] below which nothing can be thrown."""
BALL_DIVISIONS = 3
"""Of an icosahedron's faces, for balls."""


@dataclass(frozen=True)
class Body:
    """An object of a scene.

    Attributes
    ----------
    entry
        What its scene says of it.
    mass, inertia : float [kg], (3, 3) [kg m^2]
        Of the rigid body, the inertia about its centre of mass in its own axes.
    centre : (3,) [m]
        Its centre of mass, in the coordinates of the solid.
    shape
        Its surface.
    compliance : (V,) [1/Pa]
        How its material gives way at the vertices, see `sound.scenes.hertz.compliance`.
    parts : list of (n, 3) [m]
        Corners of convex parts by which it touches others, from the centre; none for a ball.
    solid
        Its modes; None if it is silent.
    listening
        Loudness and noise of a design's clips.
    turn : (3, 3)
        Rotation from the coordinates of the solid to the body's own axes; None if they agree.
    accuracy : dict
        How far its frequencies are expected to be from the solid's, see
        `sound.scenes.uniform.UniformSolid`; None if nothing is known.
    """

    entry: ObjectEntry
    mass: float
    inertia: Array
    centre: Array
    shape: Shape
    compliance: Array
    parts: list[Array]
    solid: SoundingSolid | None
    listening: Listening | None
    turn: Array | None = None
    accuracy: dict[str, Any] | None = None

    @property
    def volume(self) -> float:
        """Of its material [m^3]."""
        return self.mass / (self.entry.density if self.solid is None else self.solid.model.density)

    def motion(self, places: Array) -> Array:
        """Displacement (p, 3, k) [kg^-1/2] in each mode at places (p, 3) [m] from the centre."""
        assert self.solid is not None
        moved = self.solid.motion(self.in_solid(places))
        return moved if self.turn is None else np.einsum("ij,pjk->pik", self.turn, moved)

    def in_solid(self, places: Array) -> Array:
        """Coordinates (p, 3) [m] in the solid of places (p, 3) [m] from the centre."""
        return self.along_solid(places) + self.centre

    def along_solid(self, vectors: Array) -> Array:
        """Vectors (p, 3) of the body's own axes in those of the solid."""
        return vectors if self.turn is None else vectors @ self.turn


def body_of(entry: ObjectEntry) -> Body:
    """The body that an entry of a scene describes.

    Raises
    ------
    UserError
        With the object's name: if a file is missing or unusable, a solid has no mass or no modes.
    ConvergenceError
        With its name, too: if modes were not found.
    """
    try:
        body = _read(entry)
    except UserError as error:
        raise UserError(f"object {entry.name!r}: {_in_keys(str(error))}") from None
    except ConvergenceError as error:
        raise ConvergenceError(f"object {entry.name!r}: {error}") from None
    if not body.mass > LIGHTEST:
        raise UserError(
            f"object {entry.name!r}: has a mass of {body.mass:.3g} kg, expected more than "
            f"{LIGHTEST:g} kg; look at its unit and its density"
        )
    return body


def _in_keys(sentence: str) -> str:
    """A sentence that names options of commands, with the keys of a scene in their place."""
    keys = {"--resolution": "resolution", "--components largest": "components: largest"}
    for option, key in keys.items():
        sentence = sentence.replace(option, key)
    return sentence


def _read(entry: ObjectEntry) -> Body:
    if entry.design is not None:
        return _of_design(entry, read_design(_of_kind(entry.design, "design")))
    if entry.modes is not None:
        return _of_modes(entry, _of_kind(entry.modes, "modes"))
    if entry.radius is not None:
        return _of_ball(entry, entry.radius)
    return _of_mesh(entry)


def _of_kind(path: str, kind: str) -> str:
    found = kind_of(path, f"a Carillon {kind} file (HDF5)")[0]
    if not found:
        raise UserError(f"{path}: is no file of Carillon, expected {kind}; name a mesh by mesh")
    if found != kind:
        raise UserError(f"{path}: is a file of kind {found}, expected {kind}; name it by {found}")
    return path


def _of_design(entry: ObjectEntry, design: Design) -> Body:
    solid = SoundingSolid.of_design(design)
    rigid = mass_properties(design.model)
    shape = Shape.of_surface(design.surface_vertices, design.surface_faces, rigid.centre)
    young = design.young_near(design.surface_vertices)
    giving = compliance(young, design.model.poisson)
    listening = Listening.of_design(design, solid)
    body = _assembled(entry, rigid, shape, giving, solid, upright(design.settings.get("mesh", "")))
    return replace(body, listening=listening)


def _of_modes(entry: ObjectEntry, path: str) -> Body:
    from scipy.spatial import cKDTree

    file = read_modes(path)
    heard = file
    if entry.heard_modes is not None:
        heard = read_modes(_of_kind(entry.heard_modes, "modes"))
        require_same_solid((path, entry.heard_modes), (file, heard))
    solid = SoundingSolid.of_modes(heard, Damping(*entry.damping))
    rigid = mass_properties(file.model)
    vertices, faces = _voxel_surface(file.model)
    shape = Shape.of_surface(vertices, faces, rigid.centre)
    hexahedra = file.model.hexmesh
    centres = hexahedra.nodes[hexahedra.cells].mean(axis=1)
    moduli = file.model.young.reshape(len(file.model.young), -1).mean(axis=1)
    if len(moduli) == len(centres):
        young = moduli[cKDTree(centres).query(vertices)[1]]
    else:
        young = np.full(len(vertices), moduli.mean())
    giving = compliance(young, file.model.poisson)
    body = _assembled(entry, rigid, shape, giving, solid, upright(file.attributes.get("mesh", "")))
    told = {key: value for key, value in heard.attributes.items() if key.startswith(FROM_SOLID)}
    kept = ("discretisation", "resolution")
    told |= {key: heard.attributes[key] for key in kept if told and key in heard.attributes}
    return replace(body, accuracy=told or None)


def _voxel_surface(model: Solid) -> tuple[Array, NDArray[np.int64]]:
    from carillon.fem.geometry.faces import surface_quads

    quads = surface_quads(model.mesh)
    used, numbers = np.unique(quads, return_inverse=True)
    corners = numbers.reshape(-1, 4)
    faces = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    return model.mesh.nodes[used], faces.astype(np.int64)


def _of_ball(entry: ObjectEntry, radius: float) -> Body:
    import trimesh

    sphere = trimesh.creation.icosphere(BALL_DIVISIONS, 1.0)
    solid, accuracy = None, None
    if entry.count:
        found, size = _sized(uniform_solid(sphere, entry.name, _discretised(entry)), radius, entry)
        radius *= size
        solid, accuracy = _sounding(found, entry), found.accuracy
    sphere.apply_scale(radius)
    mass = 4.0 / 3.0 * np.pi * radius**3 * entry.density
    inertia = 0.4 * mass * radius**2 * np.eye(3)
    shape = Shape.of_surface(np.asarray(sphere.vertices), np.asarray(sphere.faces), np.zeros(3))
    shape = replace(shape, radii=np.full(len(shape.vertices), radius))
    giving = _uniform_compliance(entry, shape)
    ball = replace(entry, radius=radius)
    centre = np.zeros(3)
    return Body(ball, mass, inertia, centre, shape, giving, [], solid, None, accuracy=accuracy)


def _of_mesh(entry: ObjectEntry) -> Body:
    from carillon.fem.geometry import load_surface
    from sound.surface import longest_side, struck_surface

    assert entry.mesh is not None
    surface = struck_surface(entry.mesh, entry.unit)
    # Of the mesh's own unit, so that all that differ by theirs alone share what is found.
    longest = longest_side(surface) / entry.unit
    unit = 1.0 if EXTENTS[0] <= longest <= EXTENTS[1] else entry.unit
    own = load_surface(entry.mesh, unit)
    solved = uniform_solid(own, entry.name, _discretised(entry))
    found, size = _sized(solved, entry.unit / unit, entry)
    doubt_unit(entry.mesh, surface.extents, entry.unit)
    surface.apply_scale(size)
    rigid = mass_properties(found.model)
    shape = Shape.of_surface(np.asarray(surface.vertices), np.asarray(surface.faces), rigid.centre)
    giving = _uniform_compliance(entry, shape)
    solid = _sounding(found, entry) if entry.count else None
    body = _assembled(entry, rigid, shape, giving, solid, upright(entry.mesh))
    return replace(body, accuracy=found.accuracy if entry.count else None)


def _discretised(entry: ObjectEntry) -> Discretised:
    return Discretised(
        entry.discretisation,
        entry.resolution,
        entry.components,
        entry.material.poisson,
        entry.count,
    )


def _sized(solved: UniformSolid, size: float, entry: ObjectEntry) -> tuple[UniformSolid, float]:
    """A solid at a size, of the entry's material, and the factor that its pitch makes it larger by.

    The factor lets the first mode have the entry's pitch: frequencies go as 1 / size.
    """
    factor = 1.0
    if entry.pitch is not None:
        found = solved.scaled(size, entry.material.young, entry.density)
        assert found.eigenvalues is not None
        factor = float(np.sqrt(found.eigenvalues[RIGID_MODES])) / (2.0 * np.pi * entry.pitch)
    return solved.scaled(factor * size, entry.material.young, entry.density), factor


def _sounding(found: UniformSolid, entry: ObjectEntry) -> SoundingSolid:
    assert found.eigenvalues is not None and found.modes is not None
    damping = Damping(*entry.damping)
    return SoundingSolid.damped(found.model, found.eigenvalues, found.modes, damping)


def _uniform_compliance(entry: ObjectEntry, shape: Shape) -> Array:
    one = compliance(entry.material.young, entry.material.poisson)
    return np.full(len(shape.vertices), float(one))


def _assembled(
    entry: ObjectEntry,
    rigid: MassProperties,
    shape: Shape,
    giving: Array,
    solid: SoundingSolid | None,
    turn: Array | None,
) -> Body:
    """A body of what is known in the coordinates of its solid, which a rotation sets upright."""
    inertia = (rigid.axes * rigid.moments) @ rigid.axes.T
    if turn is not None:
        inertia = turn @ inertia @ turn.T
        shape = replace(shape, vertices=shape.vertices @ turn.T, inward=shape.inward @ turn.T)
    if entry.collision == "hull":
        parts = [hull_of(shape.vertices)]
    else:
        parts = convex_parts(shape.vertices, shape.faces)
    centre = rigid.centre
    return Body(entry, rigid.mass, inertia, centre, shape, giving, parts, solid, None, turn)
