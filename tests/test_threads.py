"""Work on trees and in narrow blocks that threads share."""

import numpy as np
import pytest

from carillon.numerics.simd_width import LANES
from carillon.numerics.small_gemm import block, lanes_of, subtract
from carillon.processes.threads import in_tree

PARENTS = [2, 2, 6, 5, 5, 6, -1, 8, -1]


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize("from_root", [False, True])
def test_a_tree_is_gone_through_in_order(threads, from_root):
    done = []

    def work(number):
        before = (
            [PARENTS[number]] if from_root else [i for i, p in enumerate(PARENTS) if p == number]
        )
        assert set(before) - {-1} <= set(done)
        done.append(number)

    in_tree(work, PARENTS, threads, from_root)
    assert sorted(done) == list(range(len(PARENTS)))


@pytest.mark.parametrize("threads", [1, 2])
def test_what_goes_wrong_in_a_tree_is_raised_and_nothing_above_is_done(threads):
    done = []

    def work(number):
        if number == 2:
            raise ValueError("planted")
        done.append(number)

    with pytest.raises(ValueError, match="planted"):
        in_tree(work, PARENTS, threads)
    assert 6 not in done


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
