"""Transfer from a solid's surface to a place where it is heard, from far away."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from carillon.arrays import Array, Complex
from carillon.command_line.counts import counted
from carillon.command_line.progress import say, track
from carillon.errors import UserError
from carillon.files.cache import remembered
from carillon.files.datasets import read
from carillon.files.hdf5 import create_h5, open_h5
from sound.radiation.air import SOUND_SPEED
from sound.radiation.boundary_elements import BoundaryElements
from sound.radiation.boundary_mesh import BoundaryMesh
from sound.radiation.modes_directivity import resolved_mesh
from sound.radiation.sphere import SurfacePoints, sphere_fields, surface_points
from sound.radiation.transfer import Transfer
from sound.shape import Shape

NEAREST = 2.0
"""Least distance of a place from the centre of mass, over that of the solid's farthest point."""
BEYOND = 1.5
"""Factor by which the band of a transfer goes beyond frequencies to either side."""
STEP = 0.05
"""Greatest distance of frequencies where a transfer is found, over the frequency."""
TURN = 0.8
"""Greatest change of phase [rad] between them, of a wave over the radius of the solid."""
_KIND, _SCHEMA = "fields", 1
_VERSION = 1  # counted up when other fields are found than before
"""Kind and schema of entries in the cache."""


@dataclass(frozen=True)
class Place:
    """A place (3,) [m] in the coordinates of a solid where it is heard, and whether its surface
    moves the air as that of a sphere does, or by boundary elements."""

    at: Array
    by_elements: bool = False


def transfer_to(
    place: Place, shape: Shape, centre: Array, hertz: tuple[float, float], name: str
) -> Transfer:
    """Transfer to a place from a solid about its centre of mass (3,) [m], for frequencies between
    two [Hz].

    The place counts as far away, so that its direction alone matters.  Raises UserError if it is
    near, and if boundary elements are not installed or the surface, which has a `name` in messages,
    is open.
    """
    away = place.at - centre
    distance = float(np.linalg.norm(away))
    radius = float(np.linalg.norm(shape.vertices, axis=1).max())
    if distance < NEAREST * radius:
        raise UserError(
            f"listen.at: lies {distance:.3g} m from the centre of mass, expected {NEAREST:g} times "
            f"as far as the solid reaches ({NEAREST * radius:.3g} m) or more: sound is computed as "
            "it is heard from far away"
        )
    direction, band = away / distance, frequencies_between(*hertz, radius)
    if not place.by_elements:
        surface = surface_points(shape)
        fields = sphere_fields(surface, direction, band)
    else:
        surface, fields = _by_elements(shape, direction, band, name)
    return Transfer.of_fields(surface.points + centre, surface.outward, band, fields)


def frequencies_between(lowest: float, highest: float, radius: float) -> Array:
    """Ascending frequencies (F,) [Hz] from which a transfer follows between two and `BEYOND`.

    Steps are `STEP` of the frequency, but let no wave turn by more than `TURN` over a radius [m].

    Examples
    --------
    >>> frequencies_between(300.0, 3000.0, 0.1).round(1)[[0, 1, -1]].tolist()
    [200.0, 210.0, 4500.0]
    """
    last = BEYOND * highest
    steps, widest = [lowest / BEYOND], TURN * SOUND_SPEED / (2.0 * np.pi * radius)
    while steps[-1] < last:
        steps.append(steps[-1] + min(STEP * steps[-1], widest))
    return np.array([*steps[:-1], last])


def _by_elements(
    shape: Shape, direction: Array, hertz: Array, name: str
) -> tuple[SurfacePoints, Complex]:
    """Fields (F, P) by boundary elements; that of a sphere where these are too coarse."""
    mesh, highest = resolved_mesh(shape, float(hertz[-1]))
    surface = _middles_of_edges(mesh)
    count = int(np.searchsorted(hertz, highest))
    if count < len(hertz):
        say(
            f"{name}: above {highest:,.0f} Hz a sphere of its surface moves the air in place of "
            "boundary elements"
        )
    low = hertz[:count]
    key = hashlib.sha256(repr(_VERSION).encode())
    for values in (mesh.vertices, mesh.faces.astype(float), direction, low):
        key.update(np.ascontiguousarray(values, dtype="<f8").tobytes())

    def found() -> Complex:
        elements = BoundaryElements(mesh)
        label = f"radiation of {name}, {counted(len(mesh.faces), 'triangle')}"
        each = track(low, label, unit="frequencies")
        return np.array([elements.field(float(frequency), direction) for frequency in each])

    at_vertices = remembered("fields", key.hexdigest(), found, _read, _write)
    following = np.roll(mesh.faces, -1, axis=1)
    middles = 0.5 * (at_vertices[:, mesh.faces] + at_vertices[:, following])
    solved = middles.reshape(len(low), -1) * surface.areas
    return surface, np.concatenate([solved, sphere_fields(surface, direction, hertz[count:])])


def _middles_of_edges(mesh: BoundaryMesh) -> SurfacePoints:
    """Points by which products of linear functions on triangles are integrated exactly."""
    normals, areas = mesh.normals_and_areas
    corners = mesh.vertices[mesh.faces]
    middles = 0.5 * (corners + np.roll(corners, -1, axis=1))
    return SurfacePoints(
        middles.reshape(-1, 3), np.repeat(normals, 3, axis=0), np.repeat(areas / 3.0, 3)
    )


def _read(path: Path) -> Complex:
    with open_h5(path, _KIND, _SCHEMA, sealed=True) as file:
        real, imaginary = (read(file, part, (None, None)) for part in ("real", "imaginary"))
        return np.asarray(real + 1j * imaginary)


def _write(path: Path, fields: Complex) -> None:
    with create_h5(path, _KIND, _SCHEMA, sealed=True) as file:
        file["real"], file["imaginary"] = fields.real, fields.imag
