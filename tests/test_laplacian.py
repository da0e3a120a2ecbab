"""Laplacian of the cells, its eigenvectors by multigrid, and the subdomains cut by coarse ones."""

import numpy as np
import pytest
import scipy.sparse as sp

from carillon.errors import ConvergenceError
from carillon.fem import cell_rows, laplacian, multigrid
from carillon.fem.aggregation import levels_of
from carillon.fem.cell_rows import CellRows
from carillon.fem.geometry import blocks_from_mesh, hexmesh_from_grid
from carillon.fem.laplacian import cell_laplacian, laplacian_modes, rough_modes
from carillon.fem.multigrid import ShiftedInverse
from carillon.processes.threads import one_thread
from solver.distribution import partition
from tests import solids


def bracket():
    """A plate with a hole and a wall on it, without any symmetry."""
    filled = np.zeros((21, 15, 13), dtype=bool)
    filled[:, :, :4] = True
    filled[:3] = True
    filled[9:14, 3:8] = False
    return hexmesh_from_grid(np.argwhere(filled), np.zeros(3), 0.01)


@pytest.fixture
def few_cells(monkeypatch):
    """Whatever is done for large meshes is done for small ones."""
    monkeypatch.setattr(laplacian, "FEW_CELLS", 100)
    monkeypatch.setattr(partition, "FEW_CELLS", 100)
    monkeypatch.setattr(partition, "FEWEST_VERTICES", 20)
    monkeypatch.setattr(laplacian, "COARSEST", 20)


def test_eigenvectors_by_multigrid_are_those_by_a_factorisation(few_cells, monkeypatch):
    mesh = bracket()
    values, vectors = laplacian_modes(mesh, 9)
    monkeypatch.setattr(laplacian, "FEW_CELLS", mesh.n_cells)
    expected_values, expected = laplacian_modes(mesh, 9)
    assert np.abs(values - expected_values).max() < laplacian.TOLERANCE
    assert np.abs(vectors - expected).max() < 1e-4 * np.abs(expected).max()
    assert np.abs(vectors.T @ vectors - np.eye(9)).max() < 1e-12


def test_every_run_has_the_same_eigenvectors(few_cells):
    assert np.array_equal(laplacian_modes(bracket(), 5)[1], laplacian_modes(bracket(), 5)[1])


def test_iterations_do_not_grow_with_the_mesh(monkeypatch):
    monkeypatch.setattr(multigrid, "MOST_ITERATIONS", 30)
    for cells in (8, 16, 32):
        mesh = solids.box_mesh(cells, cells, cells)
        matrix = cell_laplacian(mesh)
        rhs = np.random.default_rng(0).standard_normal(mesh.n_cells)
        solution = ShiftedInverse(levels_of(matrix, mesh.grid, 100), 1e-3, 1e-8).solve(rhs)
        residual = matrix @ solution + 1e-3 * solution - rhs
        assert np.linalg.norm(residual) < 1e-7 * np.linalg.norm(rhs)


@pytest.mark.parametrize("shortest", [1, 4, 1000])
@pytest.mark.parametrize("mixed", [False, True])
def test_products_add_up_in_the_order_of_the_columns(mixed, shortest, monkeypatch):
    monkeypatch.setattr(cell_rows, "SHORTEST", shortest)
    mesh = bracket()
    if mixed:  # where cells have up to 24 neighbours
        refined = np.random.default_rng(0).random(blocks_from_mesh(mesh).coarse.n_cells) < 0.5
        mesh = blocks_from_mesh(mesh, refined).coarse
    matrix = (cell_laplacian(mesh) + 0.1 * sp.identity(mesh.n_cells)).tocsr()
    rough = matrix.astype(np.float32)
    rows = CellRows(matrix)
    vector, rhs = np.random.default_rng(1).standard_normal((2, mesh.n_cells))
    product = np.empty(mesh.n_cells)
    rows.multiply(rows.padded(vector), product)
    assert np.array_equal(product, matrix @ vector)
    vector, rhs = vector.astype(np.float32), rhs.astype(np.float32)
    expected, scale = rhs - rough @ vector, np.float32(0.7) / rough.diagonal()
    residual, smoothed = np.empty_like(rhs), rows.padded(np.zeros_like(rhs))
    rows.subtract(rows.padded(vector), rhs, residual)
    assert np.array_equal(residual, expected)
    rows.smooth(rows.padded(vector), rhs, scale, smoothed)
    assert np.array_equal(smoothed, rows.padded(vector + scale * expected))


def test_cells_without_neighbours_have_rows():
    rows = CellRows(sp.csr_matrix(np.diag([2.0, 3.0])))
    product = np.empty(2)
    rows.multiply(rows.padded(np.array([1.0, -1.0])), product)
    assert product.tolist() == [2.0, -3.0]


def test_a_missed_tolerance_is_an_error(monkeypatch):
    monkeypatch.setattr(multigrid, "MOST_ITERATIONS", 1)
    mesh = bracket()
    inverse = ShiftedInverse(levels_of(cell_laplacian(mesh), mesh.grid, 20), 1e-3, 1e-8)
    with pytest.raises(ConvergenceError, match="Laplacian of .* cells missed"):
        inverse.solve(np.cos(np.arange(mesh.n_cells)))


def test_parts_that_touch_nowhere_stay_apart_on_every_level():
    # Two layers beside each other in the same blocks, joined at one end.
    filled = np.ones((16, 16, 4), dtype=bool)
    filled[:14, :, 2] = False
    mesh = hexmesh_from_grid(np.argwhere(filled), np.zeros(3), 0.01)
    levels = levels_of(cell_laplacian(mesh), mesh.grid, 4)
    assert len(levels) > 2
    for level in levels:
        assert level.sizes.sum() == mesh.n_cells
        assert np.abs(level.laplacian.sum(axis=1)).max() == 0.0
    fine = levels[0]
    first = levels[1].sums.indices
    below, above = first[fine.grid[:, 2] == 1], first[fine.grid[:, 2] == 3]
    far = fine.grid[fine.grid[:, 2] == 1][:, 0] < 14
    assert not np.isin(below[far], above).any()


def test_coarse_eigenvalues_are_near_the_fine_ones():
    mesh = solids.box_mesh(40, 12, 8)
    levels = levels_of(cell_laplacian(mesh), mesh.grid, 100)
    rough, vectors = rough_modes(levels[-1], 4)
    # Between constants the graph is 2 or 4 times too stiff along each axis.
    factor = 2.0 ** (len(levels) - 1)
    assert rough[1:] / factor == pytest.approx(laplacian_modes(mesh, 4)[0][1:], rel=0.1)
    assert (levels[-1].sizes @ vectors**2) == pytest.approx(np.ones(4))


def test_subdomains_found_on_coarse_graphs_are_as_good(few_cells, monkeypatch):
    model = solids.uniform_box(30, 18, 12, 0.01)
    cells, count = model.connectivity, 24

    def subdomains():
        node_part = partition.partition_model(model, count)
        sizes = np.bincount(node_part)
        corner_part = node_part[cells]
        return sizes, int((corner_part != corner_part[:, :1]).any(axis=1).sum())

    sizes, cut = subdomains()
    pieces = partition.subdomain_pieces(cells, partition.partition_model(model, count))
    assert pieces.max() + 1 == len(sizes) == count
    monkeypatch.setattr(partition, "FEW_CELLS", model.mesh.n_cells)
    fine_sizes, fine_cut = subdomains()
    assert sizes.max() < 1.25 * fine_sizes.max()
    assert cut < 1.1 * fine_cut


def test_subdomains_do_not_depend_on_threads(few_cells):
    mesh = solids.box_mesh(24, 16, 12)
    found = partition.partition_cells(mesh, 20)
    with one_thread():
        assert np.array_equal(partition.partition_cells(mesh, 20), found)
