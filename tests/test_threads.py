"""Work that threads share by tickets, and products with narrow blocks."""

import numpy as np
import pytest
from numba import njit

from carillon.numerics.simd_width import LANES
from carillon.numerics.small_gemm import block, lanes_of, subtract
from carillon.numerics.tickets import increase, wait_for
from carillon.processes.threads import in_parallel

PARENTS = np.array([2, 2, 6, 5, 5, 6, -1, 8, -1])


@njit(nogil=True)
def climb(counters, parents, values):
    """Every number of a tree waits for its children, and adds what they have to its own."""
    taken = increase(counters, 0)
    while taken < len(parents):
        for below in range(taken):
            if parents[below] == taken:
                wait_for(counters, 1 + below, 1)
                values[taken] += values[below]
        increase(counters, 1 + taken)
        taken = increase(counters, 0)


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_tickets_wait_for_what_earlier_ones_made(threads):
    for _ in range(100):
        counters, values = np.zeros(1 + len(PARENTS), dtype=np.int64), np.ones(len(PARENTS))
        in_parallel(climb, [(counters, PARENTS, values)] * threads, threads)
        assert values.tolist() == [1.0, 1.0, 3.0, 1.0, 1.0, 3.0, 7.0, 1.0, 2.0]
        assert counters[0] == len(PARENTS) + threads and (counters[1:] == 1).all()


def test_one_thread_does_all_tickets_if_others_do_not_begin():
    counters, values = np.zeros(1 + len(PARENTS), dtype=np.int64), np.ones(len(PARENTS))
    climb(counters, PARENTS, values)
    assert values[6] == 7.0


@pytest.mark.parametrize("width", [1, LANES, 2 * LANES + 1, 5 * LANES])
@pytest.mark.parametrize(("rows", "depth"), [(1, 1), (7, 5), (100, 400), (13, 193)])
def test_products_with_narrow_blocks(rows, depth, width):
    rng = np.random.default_rng(0)
    lanes = lanes_of(width)
    matrix = rng.standard_normal((rows, depth))
    factor, result = block(depth, lanes), block(rows + 2, lanes)
    factor.reshape(depth, -1)[:, :width] = rng.standard_normal((depth, width))
    expected = -matrix @ factor.reshape(depth, -1)
    subtract((matrix.ravel(), 0, depth, 1), rows, depth, (factor, 0, lanes), (result, 2, lanes))
    found = result.reshape(rows + 2, -1)
    np.testing.assert_allclose(found[2:], expected, atol=1e-12 * depth)
    assert (found[:2] == 0.0).all()
    # The same of the transposed matrix, and added up.
    turned = np.ascontiguousarray(matrix.T).ravel()
    subtract((turned, 0, 1, rows), rows, depth, (factor, 0, lanes), (result, 2, lanes))
    np.testing.assert_allclose(found[2:], 2.0 * expected, atol=1e-12 * depth)
