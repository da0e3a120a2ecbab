"""Solids in files: the mesh and its material, from which K and M can be assembled again."""

import h5py
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from carillon.fem.block import ALL_FILLED
from carillon.fem.finite_cells.model import FiniteCellModel, finite_cell_model
from carillon.fem.geometry import CORNER_OFFSETS, HexMesh
from carillon.fem.geometry.hanging import kinds_of_cells, makes_sense, node_places
from carillon.fem.model import ElasticModel, Solid
from carillon.fem.moduli import at_points
from carillon.files.datasets import INTEGER, number, put, read, refused
from carillon.limits import EDGES
from solver.files.cells_group import (
    FINITE_CELLS,
    get_cells,
    get_voxel_nodes,
    has_voxel_nodes,
    older_voxels,
    put_cells,
)
from solver.files.regions_group import (
    get_regions,
    get_shared,
    get_supports,
    put_regions,
    put_shared,
    put_supports,
)


def put_model(group: h5py.Group, model: Solid) -> None:
    """Write a solid, from which K and M can be assembled again."""
    mesh = model.mesh
    put(group, "nodes", model.positions, "m", "positions of the nodes")
    put(group, "node_grid", model.node_grid, "1", "integer coordinates of the nodes")
    put(group, "cells", mesh.cells, "1", "node numbers of the cells, corners in bit order")
    put(group, "grid", mesh.grid, "1", "integer coordinates of the cells")
    put_regions(group, model.regions, model.region)
    put_supports(group, model.supports)
    group.attrs["cell_edge"] = mesh.edge
    group.attrs["origin"] = mesh.origin
    if mesh.span is not None and mesh.hanging is not None:
        put(group, "span", mesh.span, "1", "edge of each cell in steps of the grid")
        put(group, "hanging", mesh.hanging, "1", "bit pattern of the cell's corners that hang")
    if isinstance(model, FiniteCellModel):
        put(group, "young", model.young, "Pa", "Young's modulus per voxel")
        put_cells(group, model.cells)
        put_shared(group[FINITE_CELLS], model.shared)
    else:
        assert isinstance(model, ElasticModel)
        _put_elements(group, model)


def _put_elements(group: h5py.Group, model: ElasticModel) -> None:
    uniform = bool((model.young == model.young[:, :1]).all())
    young = model.young[:, 0] if uniform else model.young
    put(group, "young", young, "Pa", "Young's modulus per cell or per quadrature point")
    put(group, "fill", model.fill, "1", "bit pattern of the cell's octants that hold mass")
    group.attrs["lumped"] = model.lumped
    group.attrs["lumped_share"] = model.lumped_share


def get_model(group: h5py.Group) -> Solid:
    """Read a solid written by `put_model`.

    Raises UserError if it is incomplete or its parts do not fit each other.
    """
    if FINITE_CELLS in group:
        return _finite_cell_model(group)
    grid = _grid(group)
    mesh = _mesh(group, grid, _node_grid(group), *_sizes(group, grid))
    if not _are_corners(mesh):
        raise refused(group, "cells, nodes and their places on the grid do not fit each other")
    fill = read(group, "fill", (mesh.n_cells,), INTEGER).astype(np.uint8)
    if mesh.span is not None and (fill[mesh.span == 1] != ALL_FILLED).any():
        raise refused(group, "dataset 'fill' has void octants in fine cells of a mixed mesh")
    whole = getattr(group.get("young"), "ndim", 0) == 2
    young = read(group, "young", (mesh.n_cells, 8) if whole else (mesh.n_cells,))
    if (young < 0.0).any():
        raise refused(group, "dataset 'young' holds negative moduli")
    return ElasticModel(
        mesh,
        at_points(young.astype(float, copy=False)),
        fill,
        *get_regions(group, (mesh.n_cells, 8)),
        bool(number(group, "lumped", 0.0, 1.0)),
        number(group, "lumped_share", 0.0, 1.0) if "lumped_share" in group.attrs else 0.0,
        get_supports(group),
    )


def _grid(group: h5py.Group) -> NDArray[np.int32]:
    return read(group, "grid", (None, 3), INTEGER).astype(np.int32)


def _node_grid(group: h5py.Group) -> NDArray[np.int32]:
    return read(group, "node_grid", (None, 3), INTEGER).astype(np.int32)


def _mesh(
    group: h5py.Group,
    grid: NDArray[np.int32],
    node_grid: NDArray[np.int32],
    *sizes: NDArray[np.uint8],
) -> HexMesh:
    return HexMesh(
        read(group, "cells", (len(grid), 8), INTEGER).astype(np.int32),
        grid,
        node_grid,
        _origin(group),
        number(group, "cell_edge", *EDGES),
        *sizes,
    )


def _finite_cell_model(group: h5py.Group) -> FiniteCellModel:
    grid, node_grid = _grid(group), _node_grid(group)
    if has_voxel_nodes(group):
        mesh = _mesh(group, grid, get_voxel_nodes(group))
    else:
        mesh = older_voxels(group, _mesh(group, grid, node_grid, *_sizes(group, grid)))
    if not _are_corners(mesh):
        raise refused(group, "voxels, corners and their places on the grid do not fit each other")
    cells, older = get_cells(group, mesh, node_grid)
    return finite_cell_model(
        cells,
        read(group, "young", (cells.mesh.n_cells,)),
        *get_regions(group, (cells.mesh.n_cells,)),
        get_shared(group[FINITE_CELLS], cells, group, older),
        get_supports(group),
    )


def _sizes(group: h5py.Group, grid: NDArray[np.int32]) -> tuple[NDArray[np.uint8], ...]:
    """`span` and `hanging` of the cells of a mixed mesh; nothing of one with cells of one size."""
    if not {"span", "hanging"} & set(group):
        return ()
    span = read(group, "span", (len(grid),), INTEGER)
    hanging = read(group, "hanging", (len(grid),), INTEGER)
    is_whole = span == 2
    if not (is_whole | (span == 1)).all() or (grid[is_whole] & 1).any():
        raise refused(group, "dataset 'span' holds other cells than fine ones and whole blocks")
    possible = (hanging >= 0) & (hanging <= ALL_FILLED) & ~(is_whole & (hanging != 0))
    if not possible.all() or not makes_sense()[kinds_of_cells(grid, span, hanging)].all():
        raise refused(group, "dataset 'hanging' names corners that cannot hang")
    block = np.unique(grid >> 1, axis=0, return_inverse=True)[1].ravel()
    if np.isin(block[is_whole], block[~is_whole]).any():
        raise refused(group, "dataset 'span' has blocks that are both whole and divided")
    return span.astype(np.uint8), hanging.astype(np.uint8)


def _are_corners(mesh: HexMesh) -> bool:
    """Whether every cell has the nodes at their places, and every node a cell."""
    cells, n_nodes = mesh.cells, mesh.n_nodes
    if not len(cells) or cells.min() < 0 or cells.max() >= n_nodes:
        return False
    if not (np.bincount(cells.ravel(), minlength=n_nodes) > 0).all():
        return False
    places = mesh.grid[:, None, :] + CORNER_OFFSETS
    if mesh.kinds is not None:
        places = 2 * (mesh.grid[:, None, :] >> 1) + node_places()[mesh.kinds]
    return np.array_equal(mesh.node_grid[cells], places)


def _origin(group: h5py.Group) -> Array:
    # Attributes come with an explicit byte order, which MPI does not know.
    origin = np.asarray(group.attrs["origin"]).astype(float)
    if origin.shape != (3,) or not np.isfinite(origin).all():
        raise refused(group, f"'origin' is {origin.tolist()}, expected a point")
    return origin
