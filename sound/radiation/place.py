"""Transfer from a solid's surface to a place where it is heard, from far away."""

from __future__ import annotations

import numpy as np

from carillon.arrays import Array, Complex
from carillon.command_line.progress import say
from sound.radiation.air import SOUND_SPEED
from sound.radiation.boundary_mesh import BoundaryMesh
from sound.radiation.far_place import FarPlace
from sound.radiation.modes_directivity import resolved_mesh
from sound.radiation.plane_waves import SolvedWaves
from sound.radiation.sphere import SurfacePoints, sphere_fields, surface_points
from sound.radiation.transfer import Transfer
from sound.shape import Shape

BELOW, BEYOND = 0.5, 1.15
"""Lowest and highest frequency of a transfer, over those that it is for."""
STEP, TURN = 0.05, 0.8
"""Greatest distance of a transfer's frequencies, over the frequency, and greatest change of phase
[rad] between them, of a wave over the radius of the solid."""
FIRST_STEP, FIRST_TURN = 0.2, 2.4
"""The same of frequencies where boundary elements are solved first; between these where needed."""


def transfer_to(
    place: FarPlace, shape: Shape, centre: Array, hertz: tuple[float, float], name: str
) -> Transfer:
    """Transfer to a place from a solid about its centre of mass (3,) [m], for frequencies between
    two [Hz].

    The place counts as far away, so that its direction alone matters.  Raises UserError if it is
    near, and if boundary elements are not installed or the surface, which has a `name` in messages,
    is open.
    """
    place.require_far(shape.vertices + centre)
    away = place.at - centre
    direction = away / np.linalg.norm(away)
    radius = float(np.linalg.norm(shape.vertices, axis=1).max())
    band = frequencies_between(*hertz, radius, STEP, TURN)
    if not place.by_elements:
        surface = surface_points(shape)
        fields = sphere_fields(surface, direction, band)
    else:
        first = frequencies_between(*hertz, radius, FIRST_STEP, FIRST_TURN)
        surface, fields = _by_elements(shape, direction, band, first, name)
    return Transfer.of_fields(surface.points + centre, surface.outward, band, fields)


def frequencies_between(
    lowest: float, highest: float, radius: float, step: float, turn: float
) -> Array:
    """Ascending frequencies (F,) [Hz] between two and, by `BELOW` and `BEYOND`, outside of them.

    Their distance is a `step` of the frequency, but lets no wave turn by more than `turn` [rad]
    over a radius [m].

    Examples
    --------
    >>> frequencies_between(400.0, 3000.0, 0.1, 0.05, 0.8).round(1)[[0, 1, -1]].tolist()
    [200.0, 210.0, 3450.0]
    """
    last = BEYOND * highest
    steps, widest = [BELOW * lowest], turn * SOUND_SPEED / (2.0 * np.pi * radius)
    while steps[-1] < last:
        steps.append(steps[-1] + min(step * steps[-1], widest))
    return np.array([*steps[:-1], last])


def _by_elements(
    shape: Shape, direction: Array, hertz: Array, first: Array, name: str
) -> tuple[SurfacePoints, Complex]:
    """Fields (F, P) at frequencies [Hz] by boundary elements, solved at the `first` ones and
    between; those of a sphere where they are too coarse."""
    mesh, highest = resolved_mesh(shape, float(hertz[-1]))
    surface = _middles_of_edges(mesh)
    count = int(np.searchsorted(hertz, highest))
    if count < len(hertz):
        say(
            f"{name}: above {highest:,.0f} Hz a sphere of its surface moves the air in place of "
            "boundary elements"
        )
    if not count:
        return surface, sphere_fields(surface, direction, hertz)
    last = hertz[count - 1]
    waves = SolvedWaves.of(mesh, direction, np.append(first[first < last], last), name)
    at_vertices = waves.at(hertz[:count])
    low = mesh.at_middles(at_vertices) * surface.areas
    return surface, np.concatenate([low, sphere_fields(surface, direction, hertz[count:])])


def _middles_of_edges(mesh: BoundaryMesh) -> SurfacePoints:
    """Points by which products of linear functions on triangles are integrated exactly."""
    normals, areas = mesh.normals_and_areas
    return SurfacePoints(mesh.middles, np.repeat(normals, 3, axis=0), np.repeat(areas / 3.0, 3))
