"""Quadratic tetrahedra of surfaces with holes and crossing shells, by fTetWild (Hu et al. 2020).

What is inside is told by winding numbers, as for finite cells. The package, pytetwild, is for
references of mesh files alone.
"""

import tempfile
from contextlib import chdir

import numpy as np

from carillon.arrays import Array, Index, Surface
from carillon.errors import UserError
from studies.accuracy.tetrahedra import GMSH_EDGES

ENVELOPE = 3e-4
"""Distance within which faces follow the surface, relative to the diagonal of its box."""


def wild_mesh(surface: Surface, size: float) -> tuple[Array, Index]:
    """Points (n, 3) [m] and elements (m, 10) of the inside, with edges of about `size` [m].

    Raises UserError if the package is not there.
    """
    try:
        import pytetwild
    except ImportError as error:
        raise UserError(
            f"references of mesh files need fTetWild ({error}): pip install pytetwild[all]"
        ) from error
    merged = surface.copy()
    merged.merge_vertices(merge_tex=True, merge_norm=True)
    vertices, faces = np.array(merged.vertices), np.array(merged.faces, dtype=np.int32)
    # It writes files into the folder that it runs in.
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        points, corners = pytetwild.tetrahedralize(
            vertices, faces, edge_length_abs=size, epsilon=ENVELOPE, num_threads=1
        )
    return with_middles(points, np.asarray(corners, dtype=np.int64))


def with_middles(points: Array, corners: Index) -> tuple[Array, Index]:
    """The same straight tetrahedra (m, 4) with nodes in the middles of their edges (m, 10).

    Points that no element has are left out, and elements are turned to a positive volume.

    Examples
    --------
    >>> points, elements = with_middles(np.eye(5, 3), np.array([[0, 1, 2, 3]]))
    >>> points.shape, elements.shape
    ((10, 3), (1, 10))
    """
    used, compact = np.unique(corners, return_inverse=True)
    points, corners = points[used], compact.reshape(corners.shape)
    sides = points[corners][:, 1:] - points[corners][:, :1]
    inverted = np.linalg.det(sides) < 0.0
    corners[inverted] = corners[inverted][:, [0, 2, 1, 3]]
    edges = np.sort(corners[:, GMSH_EDGES].reshape(-1, 2), axis=1)
    unique, middle = np.unique(edges, axis=0, return_inverse=True)
    nodes = len(points) + middle.reshape(-1, len(GMSH_EDGES))
    return np.vstack([points, points[unique].mean(axis=1)]), np.hstack([corners, nodes])
