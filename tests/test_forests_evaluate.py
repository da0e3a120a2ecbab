"""The compiled evaluation: bit for bit its reference and scikit-learn's walk; derivatives."""

from dataclasses import replace

import numpy as np
import pytest
from sklearn.tree import ExtraTreeRegressor

from carillon.errors import UserError
from carillon.fem.block import symmetries
from forests import coarsen, coarsen_with_derivatives
from forests.layout import pack, positions, rounded_down
from forests.model import CONSTANT, FILLED, HIGH, LOW, VOID, Model
from forests.scaling import FEATURES, LOG_FLOOR, LOG_VOID, PATTERNS, TRANSFORMS, prepare
from forests.training.growers import flatten
from forests.training.leaves import Leaves, join
from tests.forests_reference import (
    cell_order_reference,
    coarsen_reference,
    leaf_numbers,
    prepare_reference,
)

EVERY = pytest.mark.parametrize("transform", TRANSFORMS)
TREES = 3


def random_blocks(count, seed=0):
    """Uniform and log-uniform moduli, whole numbers with many ties, blocks of one material."""
    generator = np.random.default_rng(seed)
    young = generator.uniform(0.1, 10, (count, 8))
    young[::4] = 10.0 ** generator.uniform(-3, 3, young[::4].shape)
    young[1::4] = np.ceil(young[1::4] / 3)
    young[2::16] = young[2::16, :1]
    young[generator.random(young.shape) < generator.uniform(0, 0.6, (count, 1))] = 0.0
    return young[young.any(axis=1)]


def without_ties(young):
    """Blocks whose filled cells all differ: next to a tie the order of the cells changes."""
    ordered = np.sort(young, axis=1)
    return young[
        ((np.diff(ordered, axis=1) > 0.01 * ordered[:, 1:]) | (ordered[:, 1:] == 0)).all(1)
    ]


def grow(transform, trees=TREES, linear=True, seed=0, depth=12):
    """Model of random leaves on trees of scikit-learn, and the estimators (2, trees)."""
    generator = np.random.default_rng(seed)
    prepared = prepare(random_blocks(4000, seed), transform)
    estimators, forests = [], []
    for kind in (VOID, FILLED):
        features = prepared.features[prepared.filled == bool(kind)]
        target = generator.uniform(1, 2, len(features))
        grown = [
            ExtraTreeRegressor(max_depth=depth, random_state=number).fit(features, target)
            for number in range(trees)
        ]
        parts = []
        for estimator in grown:
            tree = flatten(estimator.tree_)
            coefficients = np.zeros((tree.leaves, FEATURES + 1))
            last = estimator.tree_.children_left < 0
            coefficients[:, CONSTANT] = estimator.tree_.value[last, 0, 0]
            low = high = coefficients[:, CONSTANT]
            if linear:
                coefficients[:, :CONSTANT] = 0.1 * generator.standard_normal((tree.leaves, 7))
                coefficients[:, CONSTANT] = generator.uniform(1, 2, tree.leaves)
                low, high = np.full(tree.leaves, 0.5), np.full(tree.leaves, 3.0)
            parts.append((tree, Leaves(coefficients, low, high)))
        estimators.append(grown)
        forests.append(parts)
    return Model("none", 0.25, transform, join(*forests), {}, {}), estimators


def with_pattern_roots(model):
    """Every void pattern starts at a root of its own, somewhere below the tree's root."""
    forests = model.forests
    inner = np.flatnonzero(forests.nodes["link"] >= 0)
    roots = np.random.default_rng(1).choice(inner, forests.roots.shape).astype(np.int32)
    return replace(model, forests=replace(forests, roots=roots))


@pytest.fixture(scope="module")
def models():
    return {transform: with_pattern_roots(grow(transform)[0]) for transform in TRANSFORMS}


@pytest.fixture(scope="module")
def blocks():
    return random_blocks(3000, seed=5)


def assert_as_reference(model, young):
    found = coarsen(model, young)
    np.testing.assert_array_equal(found, coarsen_reference(model, young))
    return found


@EVERY
def test_evaluation_equals_the_reference_bit_for_bit(models, transform, blocks):
    found = assert_as_reference(models[transform], blocks)
    np.testing.assert_array_equal(found, coarsen_with_derivatives(models[transform], blocks)[0])


@EVERY
@pytest.mark.parametrize("threads", [2, 3, 7])
def test_threads_change_nothing(models, transform, blocks, threads):
    model = models[transform]
    np.testing.assert_array_equal(coarsen(model, blocks, threads), coarsen(model, blocks))
    few = blocks[:3]
    np.testing.assert_array_equal(coarsen(model, few, threads), coarsen(model, few))
    one, other = (coarsen_with_derivatives(model, blocks, each) for each in (1, threads))
    np.testing.assert_array_equal(one[1], other[1])


@EVERY
@pytest.mark.parametrize("trees", [1, 2, 5])
def test_any_number_of_trees(transform, trees):
    assert_as_reference(grow(transform, trees)[0], random_blocks(200))


@EVERY
def test_prepared_rows_equal_the_reference_bit_for_bit(transform, blocks):
    for found, expected in zip(prepare(blocks, transform), prepare_reference(blocks, transform)):
        assert found.dtype == expected.dtype
        np.testing.assert_array_equal(found, expected)


@EVERY
def test_extreme_ratios_equal_the_reference_and_stay_finite(models, transform):
    generator = np.random.default_rng(0)
    young = 10.0 ** generator.uniform(-300, 300, (2000, 8))
    young[generator.random(young.shape) < 0.3] = 0.0
    young[0] = [1e300, 1e-300, 1e300, 1e-300, 0, 1e300, 5e-324, 1e300]
    young = young[young.any(axis=1)]
    found = assert_as_reference(models[transform], young)
    assert np.isfinite(found).all() and (found > 0).all()
    features = prepare(young, transform).features
    assert np.isfinite(features).all()
    missing = np.float32(LOG_VOID if transform == "log" else 0.0)
    void = prepare(young, transform).pattern[..., None] >> np.arange(FEATURES) & 1
    np.testing.assert_array_equal(features == missing, void == 1)


def thresholds_on(model, features):
    """The model's splits moved onto features, or to the float64 just next to them."""
    generator = np.random.default_rng(2)
    nodes = model.forests.nodes.copy()
    inner = nodes["link"] >= 0
    for k in range(FEATURES):
        here = inner & (nodes["link"] & 7 == k)
        chosen = generator.choice(features[..., k].ravel(), here.sum()).astype(float)
        side = generator.choice([-np.inf, np.inf], here.sum())
        step = generator.integers(0, 2, here.sum()) == 1
        nodes["threshold"][here] = rounded_down(np.where(step, np.nextafter(chosen, side), chosen))
    return replace(model, forests=replace(model.forests, nodes=nodes))


@EVERY
def test_features_exactly_on_thresholds(models, transform, blocks):
    model = thresholds_on(models[transform], prepare(blocks, transform).features)
    assert not np.array_equal(leaf_numbers(model, blocks), leaf_numbers(models[transform], blocks))
    assert_as_reference(model, blocks)


def test_thresholds_rounded_down_divide_float32_alike():
    """x <= t as float64 and as float32, for all float32 x on and next to thresholds t."""
    generator = np.random.default_rng(0)
    near = np.concatenate([generator.standard_normal(500), 10.0 ** generator.uniform(-44, 38, 500)])
    near = np.concatenate([near, -near, [0.0, 3e38, 1e-45, LOG_FLOOR, LOG_VOID]])
    near = near.astype(np.float32)
    up, down = (np.nextafter(near, np.float32(side * np.inf)) for side in (1, -1))
    thresholds = near.astype(float)
    middle = 0.5 * (near.astype(float) + up.astype(float))
    thresholds = np.concatenate(
        [thresholds, middle]
        + [np.nextafter(each, side) for each in (thresholds, middle) for side in (-np.inf, np.inf)]
        + [[3.5e38, -3.5e38, 1e300, -1e300, 1e-46, -1e-46, np.pi]]
    )
    rounded = rounded_down(thresholds)
    assert rounded.dtype == np.float32
    x = np.unique(np.concatenate([near, up, down, [np.inf, -np.inf]]).astype(np.float32))
    np.testing.assert_array_equal(x[:, None] <= rounded, x[:, None].astype(float) <= thresholds)


@EVERY
def test_leaves_are_those_of_scikit_learn(transform, blocks):
    """Also on features next to the thresholds, which scikit-learn compares as float64."""
    model, estimators = grow(transform, linear=False, depth=20)
    prepared = prepare(blocks, transform)
    numbers = leaf_numbers(model, blocks)
    origin = np.where(prepared.filled, FILLED, VOID)
    total = np.zeros(numbers.shape[:2])
    for kind in (VOID, FILLED):
        here = origin == kind
        for tree, estimator in enumerate(estimators[kind]):
            leaves = estimator.apply(prepared.features[here])
            found = model.forests.leaves[numbers[here][:, tree]]
            expected = estimator.tree_.value[leaves, 0, 0]
            np.testing.assert_array_equal(found[:, CONSTANT], expected.astype(np.float32))
            # A leaf of one is a leaf of the other: one to one.
            pairs = np.unique(np.column_stack([leaves, numbers[here][:, tree]]), axis=0)
            assert len(pairs) == len(np.unique(pairs[:, 0])) == len(np.unique(pairs[:, 1]))
            total[here] += estimator.predict(prepared.features[here])
    target = total / TREES
    expected = prepared.scale * (np.exp(target) if transform == "log" else target)
    np.testing.assert_allclose(coarsen(model, blocks), expected, rtol=1e-6)


def test_scikit_learns_own_thresholds_divide_alike():
    """Features put exactly on the float64 thresholds' neighbours."""
    generator = np.random.default_rng(0)
    features = generator.standard_normal((3000, 7)).astype(np.float32)
    target = features @ np.arange(7.0)
    grown = ExtraTreeRegressor(max_depth=9, random_state=0).fit(features, target)
    tree = flatten(grown.tree_)
    rows = generator.choice(tree.threshold[tree.left >= 0], (4000, 7)).astype(np.float32)
    rows[1::3] = np.nextafter(rows[1::3], np.float32(np.inf))
    rows[2::3] = np.nextafter(rows[2::3], np.float32(-np.inf))
    records = np.zeros((tree.leaves, 10), dtype=np.float32)
    records[:, 0] = np.arange(tree.leaves)
    arrays = (tree.feature, tree.threshold, tree.left, tree.right, tree.leaf)
    roots, nodes, leaves = pack(*arrays, tree.roots, records)
    node = np.full(len(rows), roots[0])
    while ((link := nodes["link"][node]) >= 0).any():
        chosen = rows[np.arange(len(rows)), np.where(link >= 0, link & 7, 0)]
        node = np.where(link >= 0, (link >> 3) + (chosen > nodes["threshold"][node]), node)
    np.testing.assert_array_equal(leaves[~link, 0], tree.leaf[grown.apply(rows)])


@pytest.mark.parametrize("levels", [1, 2, 3, 4, 20])
def test_nodes_are_placed_once_siblings_together_and_below_their_parents(levels):
    _, estimators = grow("log", 1)
    tree = flatten(estimators[0][0].tree_)
    size = len(tree.left)
    inner = np.tile(tree.left >= 0, 2)
    left, right = (
        np.where(inner, np.concatenate([each, each + size]), -1) for each in (tree.left, tree.right)
    )
    roots = np.array([0, size])
    place = positions(left, right, roots, levels)
    np.testing.assert_array_equal(np.sort(place), np.arange(2 * size))
    np.testing.assert_array_equal(place[roots], [0, 1])
    np.testing.assert_array_equal(place[right[inner]], place[left[inner]] + 1)
    assert (place[left[inner]] % 2 == 0).all()
    assert (place[left[inner]] > place[inner]).all()
    np.testing.assert_array_equal(positions(left, right, roots[:1], levels)[size:], -1)


@EVERY
def test_the_48_images_of_a_block_have_the_same_moduli_bit_for_bit(models, transform):
    """And the same derivatives, except where ties leave the order to the axes' names."""
    young = random_blocks(300)
    for blocks, has_ties in ((young, True), (without_ties(young), False)):
        moduli, derivatives = coarsen_with_derivatives(models[transform], blocks)
        for image in symmetries():
            moved = np.empty_like(blocks)
            moved[:, image] = blocks
            found, slopes = coarsen_with_derivatives(models[transform], moved)
            np.testing.assert_array_equal(found[:, image], moduli)
            if not has_ties:
                turned = slopes[:, image[:, None], image[None, :]]
                np.testing.assert_allclose(turned, derivatives, rtol=1e-9, atol=1e-12)


def smooth_moduli(model, young, leaves, cells):
    """E (8,) of one block by the current piece: leaves, order and bounds given, no rounding."""
    total = np.zeros(8)
    filled = young > 0
    scale = np.where(filled, young, young.sum() / 8)
    for origin in range(8):
        ratios = young[cells[origin, 1:]] / scale[origin]
        if model.transform == "log":
            with np.errstate(divide="ignore"):
                x = np.where(ratios > 0, np.maximum(np.log(ratios), LOG_FLOOR), LOG_VOID)
        else:
            x = ratios
        for tree in range(model.forests.trees):
            leaf = model.forests.leaves[leaves[origin, tree]].astype(float)
            total[origin] += np.clip(leaf[:7] @ x + leaf[CONSTANT], leaf[LOW], leaf[HIGH])
    target = total / model.forests.trees
    return scale * (np.exp(target) if model.transform == "log" else target)


def is_held(model, block, leaves):
    """Whether an answer or a feature stands so near its bounds that differences may cross them."""
    (features,) = prepare(block[None], model.transform).features
    leaf = model.forests.leaves[leaves].astype(float)
    answer = (leaf[..., :7] * features[:, None]).sum(axis=-1) + leaf[..., CONSTANT]
    near = np.minimum(np.abs(answer - leaf[..., LOW]), np.abs(answer - leaf[..., HIGH]))
    return near.min() < 1e-3 or (np.abs(features - LOG_FLOOR) < 1e-3).any()


@EVERY
def test_derivatives_are_those_of_finite_differences(models, transform):

    model = models[transform]
    young = random_blocks(400, seed=11)
    young[:40, 3] *= 1e-6  # Log features at their floor.
    moduli, derivatives = coarsen_with_derivatives(model, young)
    leaves, order = leaf_numbers(model, young), cell_order_reference(young)
    tested = 0
    for b, block in enumerate(young):
        if is_held(model, block, leaves[b]):
            continue
        tested += 1
        for j in range(8):
            if block[j] == 0:
                np.testing.assert_array_equal(derivatives[b, :, j], 0)
                continue
            step = 1e-5 * block[j]
            ends = []
            for sign in (1, -1):
                moved = block.copy()
                moved[j] += sign * step
                ends.append(smooth_moduli(model, moved, leaves[b], order[b]))
            expected = (ends[0] - ends[1]) / (2 * step)
            allowed = 1e-6 * np.abs(expected) + 1e-6 * moduli[b] / block[j]
            assert (np.abs(derivatives[b, :, j] - expected) <= allowed).all()
    assert tested > 200


@EVERY
def test_euler_identity_of_degree_one(models, transform, blocks):
    moduli, derivatives = coarsen_with_derivatives(models[transform], blocks)
    found = np.einsum("bij,bj->bi", derivatives, blocks)
    # Ratios are rounded to float32, and random slopes let large ones cancel.
    allowed = 1e-7 * blocks.max(axis=1, keepdims=True) if transform == "ratio" else 0.0
    assert (np.abs(found - moduli) <= 1e-12 * moduli + allowed).all()


@EVERY
def test_derivatives_predict_small_changes(models, transform):
    """Of the evaluation itself, whose float32 features make small differences rough."""
    model, young = models[transform], without_ties(random_blocks(4000, seed=3))
    change = 1e-3 * young * np.random.default_rng(0).uniform(-1, 1, young.shape)
    moduli, derivatives = coarsen_with_derivatives(model, young)
    moved = young + change
    same = (leaf_numbers(model, moved) == leaf_numbers(model, young)).all(axis=-1)
    predicted = moduli + np.einsum("bij,bj->bi", derivatives, change)
    error = np.abs(coarsen(model, moved) / predicted - 1)
    assert same.mean() > 0.5 and np.quantile(error[same], 0.98) < 1e-5


def test_answers_at_their_bounds_follow_the_scale_alone(blocks):
    model = grow("log")[0]
    leaves = model.forests.leaves.copy()
    leaves[:, LOW] = leaves[:, HIGH] = 50.0
    leaves[:, CONSTANT] = 0.0
    held = replace(model, forests=replace(model.forests, leaves=leaves))
    solid = blocks[(blocks > 0).all(axis=1)]
    moduli, derivatives = coarsen_with_derivatives(held, solid)
    np.testing.assert_allclose(derivatives, np.eye(8) * (moduli / solid)[:, :, None], rtol=1e-14)


def test_derivatives_are_constant_or_elasticities_are(models):
    """Within a piece: dE/de of `ratio`, elasticities of filled origins of `log`."""
    for transform in TRANSFORMS:
        model, young = models[transform], without_ties(random_blocks(4000, seed=4))
        moved = young * (1 + 1e-4 * np.random.default_rng(0).uniform(-1, 1, young.shape))
        same = (leaf_numbers(model, moved) == leaf_numbers(model, young)).all(axis=(1, 2))
        solid = same & (young > 0).all(axis=1)
        one, other = (coarsen_with_derivatives(model, each[solid]) for each in (young, moved))
        if transform == "log":
            one, other = (
                (None, slopes * each[solid][:, None] / moduli[..., None])
                for each, (moduli, slopes) in ((young, one), (moved, other))
            )
        difference = np.abs(one[1] - other[1]).max(axis=(1, 2))
        # An answer may come to its bounds in between.
        assert solid.sum() > 100 and np.quantile(difference, 0.9) < 1e-6


@pytest.mark.parametrize(
    ("young", "message"),
    [
        (np.zeros((1, 8)), "block 0 is void in all eight"),
        (np.ones(8), r"expected \(blocks, 8\)"),
        (np.ones((8, 1)), r"expected \(blocks, 8\)"),
        (np.full((1, 8), -1.0), "not negative"),
        (np.full((1, 8), np.inf), "finite"),
        (np.full((1, 8), np.nan), "finite"),
        (np.full((1, 8), 1e301), "at most 1e\\+300"),
        ([[1.0] * 8, [1.0] * 7 + [np.nan]], "block 1 must be finite"),
    ],
)
@pytest.mark.parametrize("function", [coarsen, coarsen_with_derivatives])
def test_bad_blocks_are_refused(models, young, message, function):
    with pytest.raises(UserError, match=message) as error:
        function(models["log"], young)
    assert "\n" not in str(error.value)


def test_no_blocks_are_no_mistake(models):
    assert coarsen(models["log"], np.empty((0, 8)), threads=2).shape == (0, 8)
    assert coarsen_with_derivatives(models["log"], np.empty((0, 8)))[1].shape == (0, 8, 8)


def test_whole_numbers_and_other_strides_are_taken(models, blocks):
    model = models["log"]
    np.testing.assert_array_equal(
        coarsen(model, np.asfortranarray(blocks)[::2]), coarsen(model, blocks[::2])
    )
    assert PATTERNS == 128
    whole = np.arange(1, 9)[None]
    np.testing.assert_array_equal(coarsen(model, whole), coarsen(model, whole.astype(float)))
