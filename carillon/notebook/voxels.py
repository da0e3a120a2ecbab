"""Faces of hexahedra as a notebook shows them, upright, with their stiffness or their modes."""

from collections.abc import Sequence

from carillon.arrays import Array
from carillon.drawing.solid import guess_up
from carillon.fem.geometry.faces import boundary_faces, corner_values
from carillon.fem.geometry.hexmesh import HexMesh
from carillon.fem.geometry.turning import upright_rotation
from carillon.notebook.triangles import Triangles


def voxel_triangles(
    mesh: HexMesh,
    values: Array | None = None,
    motions: Sequence[Array] = (),
    up: str | None = None,
) -> Triangles:
    """The outer faces of a mesh.

    Parameters
    ----------
    mesh
        Hexahedra.
    values : (m,)
        Of the cells, above 0, shown in colour by their logarithms.
    motions : (n, 3)
        Displacements of the nodes in some modes.
    up
        Axis that points upwards; None asks `carillon.drawing.solid.guess_up`.
    """
    turn = upright_rotation(up or guess_up(mesh)).T
    quads, cells = boundary_faces(mesh)
    corners = corner_values(mesh, mesh.nodes, quads, cells) @ turn
    moved = [corner_values(mesh, motion, quads, cells) @ turn for motion in motions]
    return Triangles.of_corners(corners, None if values is None else values[cells], moved)
