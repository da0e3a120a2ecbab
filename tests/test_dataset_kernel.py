"""The compiled steps of the fits against numpy, and the count of their operations."""

import numpy as np
import pytest

from carillon.fem.block import CELL_NODES
from carillon.numerics.simd import LANES, empty
from dataset_gen.objectives import (
    bounded,
    coarse_response,
    descent,
    energy,
    fit,
    flops,
    inertial,
    orientations,
    oversampled,
    sampled_energy,
)
from dataset_gen.objectives.elimination import (
    elimination_of,
    factor_of,
    lower_tiles_of,
)
from dataset_gen.objectives.kernel import (
    MOTIONS,
    factorise,
    form_sizes,
    multiply,
    solve_lower,
    solve_upper,
)
from dataset_gen.sampling import pattern_classes
from tests import dataset_reference as reference

CLASSES = [int(members[0]) for members in pattern_classes()]


def in_lanes(array):
    """Copy of numbers (..., LANES) in an array of lanes."""
    lanes = empty(array[..., 0].size)
    lanes[:] = array.reshape(-1, LANES)
    return lanes


def random_blocks(mask, count, seed=0):
    return np.random.default_rng(seed).uniform(0.1, 10, (count, 8)) * (mask >> np.arange(8) & 1)


@pytest.mark.parametrize("mask", CLASSES)
def test_elimination_has_every_active_node_once_and_all_fill(mask):
    elimination = elimination_of(mask)
    cells = np.flatnonzero(mask >> np.arange(8) & 1)
    assert sorted(elimination.dofs[::3] // 3) == sorted(np.unique(CELL_NODES[cells]))
    nodes = len(elimination.linked)
    matrix = elimination.linked * np.random.default_rng(0).uniform(-1, 1, (nodes, nodes))
    matrix = matrix + matrix.T + 4 * nodes * np.eye(nodes)
    occupied = np.linalg.cholesky(matrix) != 0
    np.testing.assert_array_equal(np.tril(elimination.filled), occupied)


def test_the_full_block_has_the_fill_the_module_states():
    assert elimination_of(255).filled[np.tril_indices(27)].sum() == 215


@pytest.mark.parametrize("mask", [255, 0b01101001, 1])
def test_factorisation_and_solution_are_those_of_numpy(mask):
    elimination = elimination_of(mask)
    size = len(elimination.dofs)
    generator = np.random.default_rng(1)
    blocks = np.kron(elimination.linked, np.ones((3, 3))) * generator.random((LANES, size, size))
    matrices = blocks + blocks.swapaxes(1, 2) + 3 * size * np.eye(size)
    tiles = in_lanes(np.moveaxis(lower_tiles_of(matrices, elimination.filled), 0, -1))
    loads = generator.standard_normal((size, 12, LANES))
    x = in_lanes(loads)
    factorise(elimination.factor, tiles)
    solve_lower(elimination.factor, tiles, x, 12)
    lower = np.linalg.cholesky(matrices)
    right = np.moveaxis(loads, -1, 0)
    expected = np.linalg.solve(lower, right)
    np.testing.assert_allclose(x.reshape(size, 12, LANES), np.moveaxis(expected, 0, -1), rtol=1e-9)
    solve_upper(elimination.factor, tiles, x, 12)
    expected = np.linalg.solve(matrices, right)
    np.testing.assert_allclose(x.reshape(size, 12, LANES), np.moveaxis(expected, 0, -1), rtol=1e-9)


def test_products_of_full_matrices():
    generator = np.random.default_rng(2)
    left, right = generator.random((6, 5, LANES)), generator.random((5, 12, LANES))
    out = empty(72)
    multiply(out, (in_lanes(left), 0, 5, 1), (in_lanes(right), 0, 1, 12), 6, 12, 5)
    expected = np.einsum("ikl,kjl->ijl", left, right)
    np.testing.assert_allclose(out.reshape(6, 12, LANES), expected, rtol=1e-14)
    numbers = generator.random(30)
    multiply(out, (numbers, 0, 5, 1), (in_lanes(right), 0, 1, 12), 6, 12, 5)
    expected = np.einsum("ik,kjl->ijl", numbers.reshape(6, 5), right)
    np.testing.assert_allclose(out.reshape(6, 12, LANES), expected, rtol=1e-14)


@pytest.mark.parametrize("mask", CLASSES)
def test_trace_and_norm_of_the_flexibility(mask):
    young, fine = random_blocks(mask, LANES), energy.Fine(empty(MOTIONS**2), empty(3))
    energy._fine_response(coarse_response.coarse_of(mask, 0.25), young, 0, fine)
    found = fine.norms
    for lane in range(LANES):
        exact = reference.flexibility(young[lane], 0.25)
        trace, square = np.trace(exact), (exact**2).sum()
        np.testing.assert_allclose(found[0, lane], trace, rtol=1e-9)
        np.testing.assert_allclose(found[1, lane], 2 * square + trace**2, rtol=1e-9)


def derivatives(evaluate, logs):
    """Value, gradient and Hessian at `logs` (8,) in the first lane."""
    out, point = empty(descent.DERIVATIVES), empty(8)
    point[:] = logs[:, None]
    out[:] = 0.0
    evaluate(point, out)
    np.testing.assert_array_equal(out, np.repeat(out[:, :1], LANES, axis=1))
    lower = out[descent.HESSIAN : descent.CURVATURE, 0] + out[descent.CURVATURE :, 0]
    lower = np.tril(lower.reshape(8, 8))
    hessian = lower + np.tril(lower, -1).T
    return out[descent.VALUE, 0], out[descent.GRADIENT : descent.HESSIAN, 0].copy(), hessian


def closed_form(mask, young):
    coarse = coarse_response.coarse_of(mask, 0.25)
    fine, response = energy.Fine(empty(MOTIONS**2), empty(3)), coarse_response.empty_response()
    forms = empty(9 * form_sizes(MOTIONS)[2])
    energy._fine_response(coarse, young, 0, fine)
    return lambda logs, out: energy._evaluate(coarse, fine, response, forms, logs, out)


def sampled(mask, young):
    coarse = coarse_response.coarse_of(mask, 0.25)
    unit = np.random.default_rng(5).standard_normal((len(elimination_of(mask).dofs), 6, LANES))
    loaded = sampled_energy.Loaded(empty(MOTIONS * 12), empty(12))
    room = sampled_energy.Room(empty(9 * 12), empty(MOTIONS * 12))
    response = coarse_response.empty_response()
    sampled_energy._load_block(coarse, young, unit, np.array([0.5, 1.0]), loaded)
    return lambda logs, out: sampled_energy._evaluate(coarse, loaded, response, room, logs, out)


@pytest.mark.parametrize("objective", [closed_form, sampled])
@pytest.mark.parametrize("mask", [255, 0b00010111])
def test_gradient_and_hessian_are_those_of_central_differences(objective, mask):
    evaluate = objective(mask, np.repeat(random_blocks(mask, 1), LANES, axis=0))
    logs = np.log(np.random.default_rng(6).uniform(0.5, 5, 8))
    _, gradient, hessian = derivatives(evaluate, logs)
    steps = 1e-5 * np.eye(8)
    ahead = [derivatives(evaluate, logs + step) for step in steps]
    behind = [derivatives(evaluate, logs - step) for step in steps]
    slopes = [(a[0] - b[0]) / 2e-5 for a, b in zip(ahead, behind)]
    np.testing.assert_allclose(gradient, slopes, rtol=1e-6, atol=1e-6 * np.abs(gradient).max())
    curvatures = [(a[1] - b[1]) / 2e-5 for a, b in zip(ahead, behind)]
    np.testing.assert_allclose(hessian, curvatures, rtol=0, atol=1e-7 * np.abs(hessian).max())


def test_slow_active_sets_agree_with_exchanges():
    generator = np.random.default_rng(1)
    factor = generator.standard_normal((LANES, 8, 9))
    matrices = factor @ factor.swapaxes(1, 2)
    vectors = generator.standard_normal((LANES, 8))
    expected, settled = bounded.minimise_above(matrices, vectors, np.zeros(LANES))
    matrix, vector = in_lanes(np.moveaxis(matrices, 0, -1)), in_lanes(vectors.T)
    assert settled.all()
    for lane in range(LANES):
        work = empty(8), empty(64), empty(8)
        assert bounded._grow(matrix, vector, work, lane)
        np.testing.assert_allclose(work[2][:, lane], expected[lane], rtol=1e-9, atol=1e-12)


def test_a_problem_without_minimum_is_not_called_settled():
    matrices = np.stack([np.eye(8), -np.eye(8), np.full((8, 8), np.nan)])
    _, settled = bounded.minimise_above(matrices, np.ones((3, 8)), np.zeros(3))
    assert settled.tolist() == [True, False, False]


def test_every_pattern_is_turned_to_the_least_of_its_class():
    images, turns = orientations()
    assert sorted(set(images[1:])) == CLASSES
    for mask in range(256):
        filled = mask >> np.arange(8) & 1
        moved = np.empty(8, dtype=int)
        moved[turns[mask]] = filled
        assert moved @ (1 << np.arange(8)) == images[mask]


@pytest.mark.parametrize("nodes", [6, 27])
def test_operations_of_dense_matrices_are_those_of_the_textbook(nodes):
    """n^3 / 3 for Cholesky, n^2 for each solution with L; tiles on the diagonal are done whole."""
    size, factor = 3 * nodes, factor_of(np.ones((nodes, nodes), dtype=bool))
    operations = sum(2 * j + 1 for i in range(size) for j in range(i + 1))
    assert 1 <= flops.factorisation(factor) / operations < 1 + 6 / nodes
    assert flops.factorisation(factor) == pytest.approx(size**3 / 3, rel=6 / nodes)
    assert 1 <= flops.substitution(factor, 18) / (18 * size**2) < 1 + 1.5 / nodes


def test_a_fit_of_the_full_block_costs_less_than_its_dense_factorisation_and_solution():
    """81 unknowns, 18 loads: what sparsity saves pays for all the rest."""
    with flops.counted() as found:
        fit("oversampled", np.ones((1, 8)))
    assert found == [oversampled.patch_of(255, 0.25).flops()]
    assert 300_000 < found[0] < 2 * 81**3 / 3 + 2 * 18 * 81**2
    with flops.counted() as found:
        fit("inertial", np.ones((5, 8)))
    assert found == [5 * inertial.inertia_of(255, 0.25).flops()]
