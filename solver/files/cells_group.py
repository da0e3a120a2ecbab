"""Finite cells in files, and those of older versions, which were quadratic."""

from __future__ import annotations

from dataclasses import dataclass

import h5py
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Index
from carillon.fem.finite_cells.basis import DEGREES, basis
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.hanging import COLUMNS, kinds_of_cells, places_of_kinds
from carillon.fem.geometry import HexMesh
from carillon.files.datasets import INTEGER, number, put, read, refused
from carillon.limits import EDGES

FINITE_CELLS = "finite_cells"
"""Name of the group of a solid of finite cells."""
OCTANTS = 8
"""Voxels of an undivided quadratic cell."""


@dataclass(frozen=True, eq=False)
class OlderCells:
    """What files of older versions refer to."""

    portion: Index
    """(c, 8) what cells have of voxels, by octant; -1 where that is nothing."""


def put_cells(group: h5py.Group, cells: FiniteCells) -> None:
    """Write the cells of a solid, but for its nodes and voxels."""
    inner = group.create_group(FINITE_CELLS)
    inner.attrs["degree"] = cells.degree
    inner.attrs["step"] = cells.step
    names = "node numbers of the finite cells, x fastest"
    put(inner, "nodes", cells.nodes, "1", names)
    put(inner, "corner", cells.corner, "1", "lowest corners of the cells, in steps of the nodes")
    put(inner, "span", cells.span, "1", "edges of the cells, in steps of the nodes")
    put(inner, "kinds", cells.kinds, "1", "octant and bits of what hangs, times 8, of the cells")
    put(inner, "voxel_nodes", cells.mesh.node_grid, "1", "integer coordinates of voxels' corners")
    put(inner, "cell", cells.cell, "1", "cell of each part of a voxel")
    put(inner, "place", cells.place, "1", "place of the voxel in the cell, x fastest")
    put(inner, "voxel", cells.voxel, "1", "voxel of each part")
    put(inner, "row", cells.row, "1", "row of the weights of each part")
    put(inner, "weights", cells.weights, "1", "integrals of the points' Lagrange polynomials")


def get_cells(
    group: h5py.Group, mesh: HexMesh, node_grid: NDArray[np.int32]
) -> tuple[FiniteCells, OlderCells | None]:
    """Read the cells of a solid with these voxels and nodes (n, 3).

    Raises UserError if they are incomplete or do not fit each other.
    """
    inner = group[FINITE_CELLS]
    older = None
    if "degree" in inner.attrs:
        cells = _cells(inner, mesh, node_grid)
    else:
        step = mesh.edge / (2 if "span" in group else 1)
        cells, older = _older_cells(inner, mesh, node_grid, step)
    if not cells.is_consistent():
        raise refused(inner, "cells, voxels, nodes and their places do not fit each other")
    return cells, older


def has_voxel_nodes(group: h5py.Group) -> bool:
    """Whether the voxels of finite cells have corners of their own."""
    return "voxel_nodes" in group[FINITE_CELLS]


def get_voxel_nodes(group: h5py.Group) -> NDArray[np.int32]:
    """Integer coordinates (n, 3) of the corners of voxels."""
    return read(group[FINITE_CELLS], "voxel_nodes", (None, 3), INTEGER).astype(np.int32)


def older_voxels(group: h5py.Group, mesh: HexMesh) -> HexMesh:
    """Voxels of a file of an older version, whose corners were among the nodes of the cells.

    Raises UserError if they are not of one size.
    """
    if mesh.cells.min(initial=0) < 0 or mesh.cells.max(initial=-1) >= mesh.n_nodes:
        raise refused(group, "dataset 'cells' names nodes that are not there")
    used, corners = np.unique(mesh.cells, return_inverse=True)
    corners = corners.reshape(mesh.cells.shape).astype(np.int32)
    grid, node_grid, edge = mesh.grid, mesh.node_grid[used], mesh.edge
    if mesh.span is not None:  # steps of nodes were half a voxel where cells were divided
        if (mesh.span != 2).any() or (node_grid % 2).any():
            raise refused(group, "dataset 'span' has voxels of several sizes")
        grid, node_grid, edge = grid // 2, node_grid // 2, 2.0 * edge
    return HexMesh(corners, grid, node_grid, mesh.origin, edge)


def _cells(group: h5py.Group, mesh: HexMesh, node_grid: NDArray[np.int32]) -> FiniteCells:
    degree = int(number(group, "degree", min(DEGREES), max(DEGREES)))
    if degree not in DEGREES:
        raise refused(group, f"has cells of degree {degree}, expected one of {DEGREES}")
    shape = basis(degree)
    nodes = read(group, "nodes", (None, shape.n_nodes), INTEGER).astype(np.int32)
    count = len(nodes)
    corner = read(group, "corner", (count, 3), INTEGER).astype(np.int32)
    span, kinds = (
        read(group, name, (count,), INTEGER).astype(np.int32) for name in ("span", "kinds")
    )
    cell = read(group, "cell", (None,), INTEGER).astype(np.int32)
    place, voxel, row = (
        read(group, name, (len(cell),), INTEGER).astype(np.int32)
        for name in ("place", "voxel", "row")
    )
    if kinds.min(initial=0) < 0 or kinds.max(initial=0) >= OCTANTS << (
        COLUMNS if degree == 2 else 6
    ):
        raise refused(group, "dataset 'kinds' names what cannot hang")
    if not count or span.min() < degree or nodes.min() < 0 or nodes.max() >= len(node_grid):
        raise refused(group, "cells, voxels, nodes and their places do not fit each other")
    return FiniteCells(
        degree,
        nodes,
        corner,
        span,
        kinds,
        node_grid,
        number(group, "step", *EDGES),
        mesh,
        cell,
        place,
        voxel,
        row,
        read(group, "weights", (None, shape.n_points)),
    )


def _older_cells(
    group: h5py.Group, mesh: HexMesh, node_grid: NDArray[np.int32], step: float
) -> tuple[FiniteCells, OlderCells]:
    shape = basis(2)
    nodes = read(group, "nodes", (None, shape.n_nodes), INTEGER).astype(np.int32)
    row = read(group, "row", (len(nodes),), INTEGER)
    voxels = read(group, "voxels", (len(nodes), OCTANTS), INTEGER)
    weights = read(group, "weights", (None, OCTANTS, shape.n_points))
    if not len(weights) or not np.allclose(weights[0], shape.voxels(2)):
        raise refused(group, "row 0 of 'weights' is not that of a cell all inside")
    if row.min(initial=0) < 0 or row.max(initial=0) >= len(weights):
        raise refused(group, "dataset 'row' names weights that are not there")
    if not len(nodes) or nodes.min() < 0 or nodes.max() >= len(node_grid):
        raise refused(group, "cells, voxels, nodes and their places do not fit each other")
    corner = node_grid[nodes[:, 0]]
    span = node_grid[nodes[:, -1], 0] - corner[:, 0]
    if span.min() < 2 or (span % 2).any():
        raise refused(group, "cells, voxels, nodes and their places do not fit each other")
    nodes, kinds = _in_order(group, nodes, corner, span, node_grid)
    cell, octant = np.nonzero(voxels >= 0)
    portion = np.full(voxels.shape, -1)
    portion[cell, octant] = np.arange(len(cell))
    used, which = np.unique(OCTANTS * row[cell] + octant, return_inverse=True)
    cells = FiniteCells(
        2,
        nodes,
        corner,
        span,
        kinds,
        node_grid,
        step,
        mesh,
        cell.astype(np.int32),
        octant.astype(np.int32),
        voxels[cell, octant].astype(np.int32),
        which.ravel().astype(np.int32),
        weights.reshape(-1, shape.n_points)[used],
    )
    return cells, OlderCells(portion)


def _in_order(
    group: h5py.Group,
    nodes: NDArray[np.int32],
    corner: NDArray[np.int32],
    span: NDArray[np.int32],
    node_grid: NDArray[np.int32],
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Nodes of cells in today's order, and the kinds (c,): nodes that hang are replaced otherwise.

    Once each node that hangs had that of the larger cell which is as far beyond its corner.
    """
    shape = basis(2)
    scale = (span // 2)[:, None, None]
    places = (node_grid[nodes] - corner[:, None]) // scale
    octant = corner // span[:, None] % 2
    moved = (places != shape.nodes).any(axis=2)
    hangs, every = np.zeros((len(nodes), COLUMNS), dtype=bool), np.arange(len(nodes))
    stride = np.array([1, 3, 9])
    for axis in range(3):
        middle = np.ones((len(nodes), 3), dtype=np.int64)
        middle[:, axis] = 2 * octant[:, axis]
        hangs[:, axis] = moved[every, middle @ stride]
        middle = 2 * octant
        middle[:, axis] = 1
        hangs[:, 3 + axis] = moved[every, middle @ stride]
        for column, inner in ((0, (axis + 2) % 3), (1, (axis + 1) % 3)):
            middle = 2 * octant
            middle[:, axis], middle[:, inner] = 1, 2 - middle[:, inner]
            hangs[:, 6 + 2 * axis + column] = moved[every, middle @ stride]
    kinds = kinds_of_cells(octant @ np.array([1, 2, 4]), hangs)
    wanted = places_of_kinds(2, kinds)
    same = (places[:, None] == wanted[:, :, None]).all(axis=3)
    if not same.any(axis=2).all():
        raise refused(group, "cells, voxels, nodes and their places do not fit each other")
    return np.take_along_axis(nodes, same.argmax(axis=2), axis=1), kinds
