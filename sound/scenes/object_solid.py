"""The solid of a scene's object: of a design, a modes file, a mesh or a ball."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Surface
from carillon.errors import UserError
from carillon.fem.geometry.size import doubt_unit
from carillon.fem.model import MassProperties, Solid, mass_properties
from carillon.files.hdf5 import kind_of
from carillon.limits import EXTENTS
from solver.files.modes_file import read_modes, require_same_solid
from solver.refinement.errors import FROM_SOLID
from solver.response.response import Damping
from sound.project.design_file import read_design
from sound.rendering.listening import Listening
from sound.rendering.solid import SoundingSolid
from sound.scenes.scene import ObjectEntry
from sound.scenes.uniform import Discretised, UniformSolid, uniform_solid

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
    poisson: float
    """(V, 3) [m], (F, 3), (V,) [Pa], float: surface, Young's modulus at its vertices, and Poisson's
    ratio."""
    sounding: SoundingSolid | None
    mesh: str = ""
    """str: name of the mesh file that the solid was made from, empty if there is none."""
    listening: Listening | None = None
    radius: float | None = None
    """float [m] or None: radius of a ball, None for any other solid."""
    accuracy: dict[str, Any] | None = None
    """dict or None: expected errors of the frequencies, see `sound.scenes.uniform.UniformSolid`."""


def object_solid(entry: ObjectEntry) -> ObjectSolid:
    """The solid that an entry of a scene describes.

    Raises UserError if a file is missing or unusable, or a solid cannot be made, and
    ConvergenceError if the modes were not found.
    """
    if entry.design is not None:
        return _of_design(entry.design)
    if entry.modes is not None:
        return _of_modes(entry.modes, entry.heard_modes, _damping(entry))
    if entry.radius is not None:
        return _of_ball(entry, entry.radius)
    assert entry.mesh is not None
    return _of_mesh(entry, entry.mesh)


def _of_design(path: str) -> ObjectSolid:
    design = read_design(_of_kind(path, "design"))
    sounding = SoundingSolid.of_design(design)
    return ObjectSolid(
        mass_properties(design.model),
        design.surface_vertices,
        design.surface_faces,
        design.young_near(design.surface_vertices),
        design.model.regions.mean_poisson,
        sounding,
        design.settings.get("mesh", ""),
        Listening.of_design(design, sounding),
    )


def _of_modes(path: str, heard_path: str | None, damping: Damping) -> ObjectSolid:
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
    return ObjectSolid(
        mass_properties(file.model),
        vertices,
        faces,
        _young_near(file.model, vertices),
        file.model.regions.mean_poisson,
        SoundingSolid.of_modes(heard, damping),
        file.attributes.get("mesh", ""),
        accuracy=accuracy or None,
    )


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


def _young_near(model: Solid, vertices: Array) -> Array:
    """Young's modulus (V,) [Pa] of the cells nearest to vertices (V, 3) [m]."""
    from scipy.spatial import cKDTree

    cells = model.hexmesh
    centres = cells.nodes[cells.cells].mean(axis=1)
    moduli = model.young.reshape(len(model.young), -1).mean(axis=1)
    if len(moduli) != len(centres):
        return np.full(len(vertices), moduli.mean())
    return np.asarray(moduli[cKDTree(centres).query(vertices)[1]])


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
        sounding,
        radius=radius,
        accuracy=accuracy,
    )


def _of_mesh(entry: ObjectEntry, mesh: str) -> ObjectSolid:
    from carillon.fem.geometry import load_surface
    from sound.strikes import longest_side, struck_surface

    surface = struck_surface(mesh, entry.unit)
    # In the mesh's own unit, so that objects which differ by unit alone share their modes.
    longest = longest_side(surface) / entry.unit
    unit = 1.0 if EXTENTS[0] <= longest <= EXTENTS[1] else entry.unit
    solid, factor = _uniform(load_surface(mesh, unit), entry, entry.unit / unit)
    doubt_unit(mesh, surface.extents, entry.unit)
    surface.apply_scale(factor)
    return ObjectSolid(
        mass_properties(solid.model),
        np.asarray(surface.vertices),
        np.asarray(surface.faces),
        np.full(len(surface.vertices), entry.made_of.young),
        entry.made_of.poisson,
        solid.sounding(_damping(entry)),
        mesh,
        accuracy=solid.accuracy if entry.count else None,
    )


def _uniform(surface: Surface, entry: ObjectEntry, size: float) -> tuple[UniformSolid, float]:
    """The solid inside a surface of size 1, at a size; and the factor of the entry's pitch."""
    material = entry.made_of
    how = Discretised(
        entry.discretisation, entry.resolution, entry.components, material.poisson, entry.count
    )
    solid = uniform_solid(surface, entry.name, how)
    return solid.sized(size, material.young, material.density, entry.pitch)


def _damping(entry: ObjectEntry) -> Damping:
    return Damping(entry.made_of.alpha, entry.made_of.beta)
