"""Products of a rank's rows with blocks of vectors of any width, against scipy's."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI

from carillon.numerics.simd_width import LANES
from solver.assembly import row_products
from solver.assembly.row_kernels import ROWS_NEAR, multiply
from solver.assembly.system import assemble
from solver.distribution.local_mesh import distribute
from tests import solids

WIDTHS = sorted({1, 3, LANES - 1, LANES, LANES + 1, 17, 50, 64, 71})
ROUNDING = 1e-14


@pytest.fixture(scope="module")
def system():
    return assemble(distribute(solids.random_box(7, 6, 5), comm=MPI.COMM_SELF), MPI.COMM_SELF)


@pytest.mark.parametrize("width", WIDTHS)
def test_products_are_those_of_the_sparse_matrices(width, system):
    rows, block = system.rows, np.random.default_rng(0).standard_normal((system.n_dofs, width))
    for product, matrix in (
        (rows.times_stiffness, rows.stiffness_csr(system.n_dofs)),
        (rows.times_mass, rows.mass_csr(system.n_dofs)),
    ):
        scale = abs(matrix) @ abs(block)
        assert (np.abs(product(block) - matrix @ block) <= ROUNDING * scale).all()


def test_a_column_is_the_same_bits_whatever_is_beside_it(system):
    block = np.random.default_rng(0).standard_normal((system.n_dofs, max(WIDTHS)))
    for product in (system.rows.times_stiffness, system.rows.times_mass):
        whole = product(block)
        for width in WIDTHS:
            assert (product(block[:, -width:]) == whole[:, -width:]).all()


@pytest.mark.parametrize("width", WIDTHS)
def test_projections_are_products_with_the_sparse_matrices(width, system):
    random = np.random.default_rng(width)
    left, right = (random.standard_normal((system.n_dofs, count)) for count in (13, width))
    rows = system.rows
    for product, matrix in (
        (system.project_stiffness, rows.stiffness_csr(system.n_dofs)),
        (system.project_mass, rows.mass_csr(system.n_dofs)),
    ):
        # Rows of a wider block, too.
        found = product(np.concatenate([left, left], axis=1)[:, :13], right)
        scale = abs(left.T) @ (abs(matrix) @ abs(right))
        assert found.shape == (13, width)
        assert (np.abs(found - left.T @ (matrix @ right)) <= ROUNDING * scale).all()
        within = product(left, np.concatenate([right, right], axis=1)[:, width:])
        assert (np.abs(within - found) <= 2.0 * ROUNDING * scale).all()


@pytest.mark.parametrize("threads", [1, 2])
def test_rows_of_a_product_come_once_each(threads, system, monkeypatch):
    monkeypatch.setattr(row_products, "NODES_AT_ONCE", 50)
    block = np.random.default_rng(0).standard_normal((system.n_dofs, LANES))
    products = replace(system.rows.stiffness_products, threads=threads)
    found = np.full_like(block, np.nan)

    def take(here: slice, image: np.ndarray) -> None:
        assert np.isnan(found[here]).all()
        found[here] = image

    products.by_rows(block, take)
    assert (found == products.times(block)).all()


@pytest.mark.parametrize("size", [1, 3])
def test_rows_of_ghosts_follow_the_own_ones(size):
    own, ghosts, width = 2 * ROWS_NEAR + 1, 40, LANES + 3
    random = np.random.default_rng(size)
    graph = sp.random(own, own + ghosts, 0.1, format="csr", random_state=1)
    graph.sort_indices()
    blocks = random.standard_normal((graph.nnz, size, size))
    vectors = random.standard_normal((size * (own + ghosts), width))
    result = np.full((size * own, width), np.nan)
    columns = graph.indices.astype(np.int64), graph.indptr.astype(np.int64)
    for rows in ((0, 5), (5, own)):
        multiply(rows, columns[::-1], blocks, vectors[: size * own], vectors[size * own :], result)
    shape = (size * own, size * (own + ghosts))
    matrix = sp.bsr_matrix((blocks, graph.indices, graph.indptr), shape=shape)
    np.testing.assert_allclose(result, matrix @ vectors, atol=1e-12)
