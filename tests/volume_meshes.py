"""Volume meshes of boxes for tests, of every kind of element, and written to files by meshio."""

import meshio
import numpy as np

from carillon.fem.geometry.cell_shapes import SHAPES
from carillon.fem.geometry.volume_mesh import VolumeMesh

# A cube cut into elements, by numbers of its corners in VTK's order.
_PYRAMIDS = [[*face, 8] for face in SHAPES["hexahedron"].faces]
_CUBE = {
    "hexahedron": [[0, 1, 2, 3, 4, 5, 6, 7]],
    "wedge": [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]],
    "pyramid": _PYRAMIDS,
    "tetra": [[p[0], *pair, 8] for p in _PYRAMIDS for pair in ((p[1], p[2]), (p[2], p[3]))],
}
_CORNERS = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
)


def linear(kind: str, counts: tuple[int, int, int], sides=(1.0, 1.0, 1.0)):
    """Points and elements of a box of so many cubes."""
    places = {}
    cells = []

    def number(place):
        return places.setdefault(tuple(place), len(places))

    for cube in np.ndindex(*counts):
        corners = [number(2 * (np.array(cube) + corner)) for corner in _CORNERS]
        corners.append(number(2 * np.array(cube) + 1) if kind in ("pyramid", "tetra") else -1)
        cells += [[corners[each] for each in cell] for cell in _CUBE[kind]]
    points = np.array(list(places)) / 2.0 / np.array(counts) * np.array(sides)
    return points, np.array(cells)


def quadratic(name: str, points, cells):
    """The same with nodes in the middles of edges, and of faces where the kind has them."""
    shape = SHAPES[name]
    groups = [*shape.edges, *(shape.faces[face] for face in sorted(shape.middles))]
    if name == "hexahedron27":
        groups.append(tuple(range(8)))
    made, places = {}, list(points)
    rows = []
    for cell in cells:
        row = list(cell)
        for group in groups:
            key = tuple(sorted(cell[list(group)]))
            if key not in made:
                made[key] = len(places)
                places.append(points[list(key)].mean(axis=0))
            row.append(made[key])
        rows.append(row)
    return np.array(places), np.array(rows)


def box(name: str, counts=(3, 2, 2), sides=(0.3, 0.2, 0.1), bend=None):
    """Points and elements of a box, whose points `bend` may move."""
    points, cells = linear(name.rstrip("0123456789"), counts, sides)
    if SHAPES[name].edges:
        points, cells = quadratic(name, points, cells)
    return (points if bend is None else bend(points)), cells


def volume_mesh(name: str, **how) -> VolumeMesh:
    points, cells = box(name, **how)
    return VolumeMesh(name, points, [(name, cells)])


def write(path, points, blocks, cell_data=None, **more) -> str:
    """Write a mesh with meshio and return its name."""
    meshio.Mesh(points, blocks, cell_data=cell_data or {}).write(path, **more)
    return str(path)
