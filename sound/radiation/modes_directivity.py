"""Directivity of a solid's modes by boundary elements, which is kept in the user's cache."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from carillon.arrays import Array
from carillon.command_line.counts import counted
from carillon.command_line.progress import say, track
from carillon.errors import UserError
from carillon.files.cache import remembered
from carillon.files.hdf5 import create_h5, open_h5
from sound.radiation.air import SOUND_SPEED
from sound.radiation.boundary_elements import radiated_by_elements, same_frequency
from sound.radiation.boundary_mesh import BoundaryMesh, boundary_mesh
from sound.radiation.cache_entries import get_complex, key_of, put_complex
from sound.radiation.directivity import Directivity
from sound.radiation.outer_surface import outer_faces
from sound.radiation.sphere import radiated
from sound.shape import Shape

FEWEST_TRIANGLES, MOST_TRIANGLES = 2000, 4000
"""Bounds of the number of triangles of a surface; the time goes as its square."""
EDGES_PER_WAVE = 6.0
"""Edges of triangles in a wave at the highest frequency, where the bounds let them."""
FEWEST_EDGES_PER_WAVE = 4.0
"""Edges in a wave below which a sphere stands for the surface."""
HIGHEST_HERTZ = 20_000.0
"""Frequency [Hz] from which a sphere stands for the surface, since nobody hears more."""
_KIND, _SCHEMA = "directivity", 1
_VERSION = 2  # counted up when other directivities are found than before
"""Kind and schema of entries in the cache."""


def modes_directivity(
    name: str, shape: Shape, motion: Callable[[Array], Array], frequencies: Array
) -> Directivity:
    """Directivity of modes of ascending frequencies (N,) [Hz] by boundary elements.

    `motion` gives the displacements (p, 3, N) [kg^-1/2] of places (p, 3) [m] of the surface.
    Frequencies too high for `MOST_TRIANGLES`, and surfaces that are open, are heard as
    `sound.radiation.sphere` has it, which a line tells.  Raises UserError if bempp-cl is not
    installed.
    """

    def sphere() -> Directivity:
        return radiated(motion(shape.vertices), shape, frequencies).directivity

    audible = frequencies[frequencies < HIGHEST_HERTZ]
    if not len(audible):
        return sphere()
    try:
        mesh, highest = resolved_mesh(shape, audible[-1])
    except UserError as error:
        say(f"{name!r} is heard as a sphere of its surface moves the air: {error}")
        return sphere()
    count = int(np.searchsorted(audible, highest))
    if count < len(audible):
        say(
            f"{name!r}: above {highest:,.0f} Hz a sphere of its surface moves the air in place of "
            f"boundary elements ({counted(len(audible) - count, 'mode')})"
        )
    if not count:
        return sphere()
    moved, low = motion(mesh.middles)[:, :, :count], frequencies[:count]
    key = key_of((_VERSION, FEWEST_EDGES_PER_WAVE), mesh.vertices, mesh.faces, moved, low)

    def found() -> Directivity:
        label = f"radiation of {name!r}, {len(mesh.faces):,} triangles"
        groups = track(same_frequency(low), label, unit="frequencies")
        return radiated_by_elements(mesh, moved, low, groups)

    solved = remembered("directivity", key, found, _read, _write)
    return solved if count == len(frequencies) else solved.with_modes_after(sphere())


def resolved_mesh(shape: Shape, highest: float) -> tuple[BoundaryMesh, float]:
    """Triangles of even size for frequencies up to `highest` [Hz], and that up to which they are
    fine enough.

    Raises UserError if the surface is open, or encloses nothing.
    """
    outer = outer_faces(shape.vertices, shape.faces)
    mesh = boundary_mesh(shape.vertices, outer, _triangles(shape, highest))
    return mesh, SOUND_SPEED / (FEWEST_EDGES_PER_WAVE * _edge(mesh))


def _triangles(shape: Shape, highest: float) -> int:
    """Number of triangles that resolve waves of the highest frequency [Hz]."""
    import trimesh

    area = float(trimesh.triangles.area(shape.vertices[shape.faces]).sum())
    edge = SOUND_SPEED / highest / EDGES_PER_WAVE
    wanted = area / (np.sqrt(3.0) / 4.0 * edge**2)
    return int(np.clip(wanted, FEWEST_TRIANGLES, MOST_TRIANGLES))


def _edge(mesh: BoundaryMesh) -> float:
    """Length [m] of the edges, in the median over the triangles' longest ones."""
    corners = mesh.vertices[mesh.faces]
    lengths = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    return float(np.median(lengths.max(axis=1)))


def _read(path: Path) -> Directivity:
    with open_h5(path, _KIND, _SCHEMA, sealed=True) as file:
        return Directivity(get_complex(file))


def _write(path: Path, directivity: Directivity) -> None:
    with create_h5(path, _KIND, _SCHEMA, sealed=True) as file:
        put_complex(file, directivity.coefficients)
