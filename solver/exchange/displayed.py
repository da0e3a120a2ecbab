"""What shows a solid: cubes of its elements or of the voxels of its finite cells, or its surface.

Corners that hang between larger elements are points of their own, so that every cube has eight, at
its own corners, and is seen where the model has it.
"""

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from carillon.arrays import Array, Index, Surface
from carillon.errors import UserError
from carillon.fem.finite_cells.model import FiniteCellModel
from carillon.fem.geometry.hanging import node_weights
from carillon.fem.model import ElasticModel, Solid
from carillon.files.vtu import HEXAHEDRON, HEXAHEDRON_CORNERS, TRIANGLE
from solver.response.points import interpolation

YOUNG, DENSITY, REGION = "Young's modulus [Pa]", "density [kg/m^3]", "region"
"""Arrays of the cubes: means over each of them, what of it is void included in the density."""
MOST_TRIANGLES = 20_000_000
"""Triangles that a surface may be cut into."""


@dataclass(frozen=True, eq=False)
class Displayed:
    """Cells that show a solid."""

    points: Array
    """(p, 3) [m]."""
    cells: Index
    """(c, k) points of each, in VTK's order."""
    kind: int
    """VTK's number of the kind of cell."""
    interpolation: sp.csr_matrix | None
    """(p, n) values of the points from those of the nodes; None if points are the nodes."""
    data: dict[str, Array] = field(default_factory=dict)
    """(c,) of each array of the cells."""

    def vectors(self, displacement: Array) -> Array:
        """Displacement (p, 3) of the points from that (n, 3) of the nodes."""
        if self.interpolation is None:
            return displacement
        return np.asarray(self.interpolation @ displacement)


def displayed(model: Solid) -> Displayed:
    """The cubes of a solid; points come in the order of the nodes, those that hang after them.

    Elements are one cube each, void octants of coarse ones with them. Of finite cells the voxels
    that hold material are shown, whose corners move with the cells.
    """
    mesh = model.mesh
    cells, matrix = mesh.cells, None
    is_finite = isinstance(model, FiniteCellModel)
    if isinstance(model, FiniteCellModel):
        share = model.cells.voxel_shares()
        matrix = interpolation(model, mesh.nodes)
    else:
        assert isinstance(model, ElasticModel)
        share = model.filled.mean(axis=1)
        if mesh.kinds is not None and mesh.hanging is not None:
            cells, matrix = _with_hanging(mesh.cells, mesh.hanging, node_weights()[mesh.kinds])
    points = mesh.nodes if is_finite or matrix is None else matrix @ mesh.nodes
    young = model.young.reshape(mesh.n_cells, -1).mean(axis=1)
    data = {YOUNG: young, DENSITY: _density(model, share)}
    if model.region is not None:
        data[REGION] = _region(model).astype(np.int32)
    return Displayed(points, cells[:, HEXAHEDRON_CORNERS], HEXAHEDRON, matrix, data)


def _region(model: Solid) -> NDArray[np.integer]:
    """Region (m,) of each cube; of a coarse element the one that most of it is of."""
    assert model.region is not None
    if model.region.ndim == 1:
        return model.region
    assert isinstance(model, ElasticModel)
    filled = model.filled
    votes = ((model.region[:, :, None] == model.region[:, None]) & filled[:, None]).sum(axis=2)
    most = np.where(filled, votes, -1).argmax(axis=1)
    return np.asarray(model.region[np.arange(len(most)), most])


def _density(model: Solid, share: Array) -> Array:
    """Mean density (m,) [kg/m^3] of cubes of which a share (m,) holds material."""
    density = model.regions.density
    if model.region is None:
        return float(density[0]) * share
    if model.region.ndim == 1:
        return np.asarray(density[model.region] * share)
    assert isinstance(model, ElasticModel)
    return np.asarray((density[model.region] * model.filled).mean(axis=1))


def displayed_surface(model: Solid, surface: Surface, name: str) -> Displayed:
    """The surface of a solid, cut into triangles no longer than a voxel, moved with its elements.

    Raises UserError if it is the surface of something else, or would be cut into too many.
    """
    from trimesh.remesh import subdivide_to_size

    edge, box = model.mesh.edge, np.asarray(surface.bounds)
    apart = np.abs(box - model.mesh.bounds).max()
    if apart > 2.0 * edge:
        raise UserError(
            f"{name}: its box is up to {apart:.4g} m off that of the modes, expected the surface "
            "of their solid; see whether --unit is that of the modes"
        )
    count = len(surface.faces) + 8.0 * surface.area / edge**2
    if count > MOST_TRIANGLES:
        raise UserError(
            f"{name}: would be cut into about {count:.2g} triangles, the limit is "
            f"{MOST_TRIANGLES:,}; leave out --surface"
        )
    points, faces = subdivide_to_size(surface.vertices, surface.faces, edge, max_iter=64)
    points = np.asarray(points)
    return Displayed(points, np.asarray(faces), TRIANGLE, interpolation(model, points))


def _with_hanging(
    nodes: NDArray[np.int32], hanging: NDArray[np.uint8], weights: Array
) -> tuple[Index, sp.csr_matrix]:
    """Points (c, 8) of cubes, and the matrix from nodes to points.

    `nodes` (c, 8) of elements are at the corners that do not hang, see `HexMesh`; `weights`
    (c, 8, 8) are theirs in the values at the corners.
    """
    cell, corner = np.nonzero(hanging[:, None] >> np.arange(8) & 1)
    count = int(nodes.max()) + 1
    rows = np.repeat(np.arange(len(cell)), 8)
    data = (weights[cell, corner].ravel(), (rows, nodes[cell].ravel()))
    each = sp.csr_matrix(data, shape=(len(cell), count))
    each.eliminate_zeros()
    each.sort_indices()
    first, number = _distinct_rows(each)
    cells = nodes.astype(np.int64)
    cells[cell, corner] = count + number
    return cells, sp.vstack([sp.identity(count), each[first]], format="csr")


def _distinct_rows(matrix: sp.csr_matrix) -> tuple[Index, Index]:
    """First of the rows that are means of the same nodes, and which of these each row is."""
    longest = int(np.diff(matrix.indptr).max(initial=0))
    row = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    table = np.full((matrix.shape[0], longest), -1)
    table[row, np.arange(matrix.nnz) - matrix.indptr[row]] = matrix.indices
    _, first, number = np.unique(table, axis=0, return_index=True, return_inverse=True)
    return first, number.ravel()
