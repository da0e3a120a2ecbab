"""An object of a scene: a rigid body with a surface that gives way and modes that sound."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from carillon.errors import UserError
from carillon.fem.geometry.size import doubt_unit
from carillon.fem.model import RIGID_MODES, Solid
from carillon.fem.rigid import MassProperties, mass_properties
from carillon.files import kind_of
from carillon.threads import one_thread
from solver.files.modes_file import read_modes
from solver.response.response import Damping
from sound.project.design import Design
from sound.project.design_file import read_design
from sound.rendering.listening import Listening
from sound.rendering.solid import SoundingSolid
from sound.scenes.convex import convex_parts, hull_of
from sound.scenes.hertz import compliance
from sound.scenes.scene import ObjectEntry
from sound.scenes.shape import Shape

if TYPE_CHECKING:  # Its import takes long.
    import trimesh

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

    @property
    def volume(self) -> float:
        """Of its material [m^3]."""
        return self.mass / (self.entry.density if self.solid is None else self.solid.model.density)

    def motion(self, places: Array) -> Array:
        """Displacement (p, 3, k) [kg^-1/2] in each mode at places (p, 3) [m] from the centre."""
        assert self.solid is not None
        return self.solid.motion(places + self.centre)


def body_of(entry: ObjectEntry) -> Body:
    """The body that an entry of a scene describes.

    Raises
    ------
    UserError
        With the object's name: if a file is missing or unusable, a solid has no mass or no modes.
    """
    try:
        body = _read(entry)
    except UserError as error:
        raise UserError(f"object {entry.name!r}: {error}") from None
    if not body.mass > LIGHTEST:
        raise UserError(
            f"object {entry.name!r}: has a mass of {body.mass:.3g} kg, expected more than "
            f"{LIGHTEST:g} kg; look at its unit and its density"
        )
    return body


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
    return _assembled(entry, rigid, shape, giving, solid, listening)


def _of_modes(entry: ObjectEntry, path: str) -> Body:
    from scipy.spatial import cKDTree

    file = read_modes(path)
    solid = SoundingSolid.of_modes(file, Damping(*entry.damping))
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
    return _assembled(entry, rigid, shape, giving, solid, None)


def _voxel_surface(model: Solid) -> tuple[Array, NDArray[np.int64]]:
    from carillon.fem.geometry.faces import surface_quads

    quads = surface_quads(model.mesh)
    used, numbers = np.unique(quads, return_inverse=True)
    corners = numbers.reshape(-1, 4)
    faces = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    return model.mesh.nodes[used], faces.astype(np.int64)


def _of_ball(entry: ObjectEntry, radius: float) -> Body:
    import trimesh

    sphere = trimesh.creation.icosphere(BALL_DIVISIONS, radius)
    size, _, solid = _sounding(entry, sphere) if entry.count else (1.0, None, None)
    sphere.apply_scale(size)
    radius *= size
    mass = 4.0 / 3.0 * np.pi * radius**3 * entry.density
    inertia = 0.4 * mass * radius**2 * np.eye(3)
    shape = Shape.of_surface(np.asarray(sphere.vertices), np.asarray(sphere.faces), np.zeros(3))
    shape = replace(shape, radii=np.full(len(shape.vertices), radius))
    giving = _uniform_compliance(entry, shape)
    ball = replace(entry, radius=radius)
    return Body(ball, mass, inertia, np.zeros(3), shape, giving, [], solid, None)


def _of_mesh(entry: ObjectEntry) -> Body:
    from sound.surface import struck_surface

    assert entry.mesh is not None
    surface = struck_surface(entry.mesh, entry.unit)
    size, model, solid = _sounding(entry, surface)
    doubt_unit(entry.mesh, surface.extents, entry.unit)
    surface.apply_scale(size)
    rigid = mass_properties(model)
    shape = Shape.of_surface(np.asarray(surface.vertices), np.asarray(surface.faces), rigid.centre)
    return _assembled(entry, rigid, shape, _uniform_compliance(entry, shape), solid, None)


def _sounding(
    entry: ObjectEntry, surface: trimesh.Trimesh
) -> tuple[float, Solid, SoundingSolid | None]:
    """Factor of its size, the solid inside a surface at that size, and its modes that sound.

    The factor lets the first mode have the entry's pitch: frequencies go as 1 / size.
    """
    from carillon.fem.geometry import hexmesh_from_voxels, voxelize
    from carillon.fem.model import fine_model

    material = entry.material
    mesh = hexmesh_from_voxels(voxelize(surface, entry.resolution, name=entry.name))
    young = np.full(mesh.n_cells, material.young)
    model = fine_model(mesh, young, poisson=material.poisson, density=entry.density)
    if entry.count == 0:
        return 1.0, model, None
    from solver.analysis.library import solve

    with one_thread():
        found = solve(model, modes=RIGID_MODES + entry.count)
    assert found.modes is not None
    size = 1.0 if entry.pitch is None else float(found.frequencies[RIGID_MODES]) / entry.pitch
    scaled = replace(mesh, origin=size * mesh.origin, edge=size * mesh.edge)
    model = replace(model, mesh=scaled)
    values, modes = found.eigenvalues / size**2, found.modes / size**1.5
    return size, model, SoundingSolid.damped(model, values, modes, Damping(*entry.damping))


def _uniform_compliance(entry: ObjectEntry, shape: Shape) -> Array:
    one = compliance(entry.material.young, entry.material.poisson)
    return np.full(len(shape.vertices), float(one))


def _assembled(
    entry: ObjectEntry,
    rigid: MassProperties,
    shape: Shape,
    giving: Array,
    solid: SoundingSolid | None,
    listening: Listening | None,
) -> Body:
    inertia = (rigid.axes * rigid.moments) @ rigid.axes.T
    if entry.collision == "hull":
        parts = [hull_of(shape.vertices)]
    else:
        parts = convex_parts(shape.vertices, shape.faces)
    return Body(entry, rigid.mass, inertia, rigid.centre, shape, giving, parts, solid, listening)
