"""Two-step training: regression in leaves, linear splits, streaming, and trees grown apart."""

from dataclasses import replace

import numpy as np
import pytest

from carillon.errors import UserError
from carillon.processes.threads import blas_threads
from dataset_gen.generate import generate
from dataset_gen.settings import ShardOptions
from forests.scaling import PATTERNS
from forests.training.dataset import dataset_of, open_dataset
from forests.training.exact_sums import Sums
from forests.training.growers import GROWERS
from forests.training.growing import grow_trees
from forests.training.leaves import ANCESTOR_ROWS, solve_leaves
from forests.training.moments import ENTRIES, fit_errors, solve
from forests.training.options import TrainingOptions, parameters_of
from forests.training.ranks import Ranks
from forests.training.routing import leaf_of
from forests.training.spent import Spent
from forests.training.structure import Rows, TreeLimits, tree_of
from forests.training.tree_file import load_trees, save_tree
from tests.shard_files import write_shard
from tests.small_forests import train

QUICK = TrainingOptions(trees=2, max_leaves=300, structure_rows=20_000)


def rows_from(features, target, weight=None, pattern=None):
    count = len(target)
    return Rows(
        np.asarray(features, dtype=np.float32),
        np.zeros(count, dtype=np.uint8) if pattern is None else pattern,
        np.asarray(target, dtype=float),
        np.ones(count) if weight is None else weight,
    )


def packed(rows):
    z = np.column_stack([rows.features.astype(float), np.ones(len(rows)), rows.target])
    full = (rows.weight[:, None] * z).T @ z
    return full[np.tril_indices(9)]


@pytest.fixture
def cloud():
    generator = np.random.default_rng(0)
    features = generator.standard_normal((500, 7)) * np.logspace(-2, 1, 7) + 3.0
    target = features @ np.arange(7) + generator.standard_normal(500)
    return rows_from(features, target, generator.uniform(0.5, 2.0, 500))


def test_sums_give_the_weighted_least_squares_fit(cloud):
    root = np.sqrt(cloud.weight)
    matrix = np.column_stack([cloud.features.astype(float), np.ones(len(cloud))])
    expected, error, *_ = np.linalg.lstsq(matrix * root[:, None], cloud.target * root, rcond=None)
    sums = packed(cloud)
    assert sums.shape == (ENTRIES,)
    np.testing.assert_allclose(solve(sums[None])[0], expected, rtol=1e-4, atol=1e-4)
    (found,) = fit_errors(sums[None])
    # The ridge counts for one part in ten million of the target.
    np.testing.assert_allclose(found, error[0], rtol=1e-3)


def test_a_constant_feature_gets_no_slope(cloud):
    cloud.features[:, 3] = -14.5
    (found,) = solve(packed(cloud)[None])
    assert found[3] == 0.0 and (found[[0, 1, 2, 4, 5, 6]] != 0.0).all()


def test_coefficients_are_the_same_bits_with_any_threads_of_blas(cloud):
    clouds = [packed(replace(cloud, target=cloud.target * n)) for n in range(1, 500)]
    sums = np.array(clouds)
    with blas_threads(1):
        one = solve(sums)
    with blas_threads(2):
        two = solve(sums)
    np.testing.assert_array_equal(one, two)


def stump():
    """One split at feature 0 <= 0, two leaves."""
    index = [np.array(values) for values in ([0, 0, 0], [1, -1, -1], [2, -1, -1])]
    return tree_of(index[0], np.zeros(3), index[1], index[2], np.zeros(PATTERNS))


def add_rows(sums, tree, rows):
    leaf_numbers = leaf_of(tree, rows.features, rows.pattern)
    sums.add(leaf_numbers, rows.features, rows.target, rows.weight)


def fitted(tree, rows, prior):
    sums = Sums.nothing(tree.leaves)
    add_rows(sums, tree, rows)
    return solve_leaves(tree, sums, prior)


def test_leaf_regression_recovers_linear_functions():
    features = np.random.default_rng(0).standard_normal((5000, 7)).astype(np.float32)
    slopes = np.array([np.arange(8.0), -np.arange(8.0)])
    side = (features[:, 0] > 0).astype(int)
    target = (slopes[side, :7] * features).sum(axis=1) + slopes[side, 7]
    leaves = fitted(stump(), rows_from(features, target), prior=1e-9)
    np.testing.assert_allclose(leaves.coefficients, slopes, atol=1e-5)
    assert leaves.low[0] == target[side == 0].min() and leaves.high[1] == target[side == 1].max()


@pytest.mark.parametrize("rows_right", [0, 1])
def test_a_leaf_without_enough_rows_takes_the_function_around_it(rows_right):
    features = np.random.default_rng(0).standard_normal((200, 7)).astype(np.float32)
    features[:, 0] = -np.abs(features[:, 0])
    features[:rows_right, 0] = 1.0
    target = features @ np.arange(1.0, 8.0) + 2.0
    leaves = fitted(stump(), rows_from(features, target), prior=0.5)
    np.testing.assert_allclose(leaves.coefficients[1], [1, 2, 3, 4, 5, 6, 7, 2], atol=1e-3)
    assert leaves.low[1] == target.min() and leaves.high[1] == target.max()
    assert len(target) > ANCESTOR_ROWS


def test_weights_count_like_repeated_rows(cloud):
    repeats = np.random.default_rng(1).integers(1, 4, len(cloud))
    weighted = replace(cloud, weight=repeats.astype(float))
    chosen = np.repeat(np.arange(len(cloud)), repeats)
    repeated = rows_from(cloud.features[chosen], cloud.target[chosen])
    one, two = (fitted(stump(), rows, prior=1e-12) for rows in (weighted, repeated))
    np.testing.assert_allclose(one.coefficients, two.coefficients, rtol=1e-6, atol=1e-6)


def test_sums_over_parts_are_the_sums_over_all(cloud):
    whole, parts = Sums.nothing(2), Sums.nothing(2)
    add_rows(whole, stump(), cloud)
    for piece in np.array_split(np.arange(len(cloud)), 7):
        columns = [getattr(cloud, name)[piece] for name in vars(cloud)]
        add_rows(parts, stump(), Rows(*columns))
    whole.carry()
    parts.carry()
    for (name, one), (_, other) in zip(whole.arrays(), parts.arrays(), strict=True):
        np.testing.assert_array_equal(one, other, err_msg=name)


def predict(tree, rows):
    leaves = fitted(tree, rows, prior=1e-6)
    coefficients = leaves.coefficients[leaf_of(tree, rows.features, rows.pattern)]
    return (rows.features * coefficients[:, :7]).sum(axis=1) + coefficients[:, 7]


@pytest.fixture(scope="module")
def kinks():
    generator = np.random.default_rng(0)
    features = generator.standard_normal((20_000, 7)).astype(np.float32)
    target = np.abs(features[:, 0]) + np.maximum(features[:, 1], features[:, 2]) + features[:, 3]
    return rows_from(features, target, pattern=generator.integers(0, 3, 20_000, dtype=np.uint8))


def test_linear_splits_find_kinks_where_variance_splits_follow_trends(kinks):
    limits = TreeLimits(max_leaves=60, min_leaf=30, depth=20)
    error = {
        name: np.std(predict(GROWERS[name](kinks, limits, 0), kinks) - kinks.target)
        for name in GROWERS
    }
    assert error["linear"] < 0.6 * min(error["best"], error["extra"])


@pytest.mark.parametrize("name", GROWERS)
def test_trees_keep_their_limits(name, kinks):
    for limits in (TreeLimits(50, 100, 20), TreeLimits(10_000, 500, 20), TreeLimits(10_000, 10, 4)):
        tree = GROWERS[name](kinks, limits, 0)
        count = np.bincount(leaf_of(tree, kinks.features, kinks.pattern), minlength=tree.leaves)
        assert 2 <= tree.leaves <= limits.max_leaves
        assert count.min() >= limits.min_leaf
        assert tree.depth <= limits.depth


def test_a_tree_of_fewer_leaves_is_the_beginning_of_a_larger_one(kinks):
    """Splits are made where they gain most: none is lost when more leaves are allowed."""
    small, large = (GROWERS["linear"](kinks, TreeLimits(leaves, 30, 20), 7) for leaves in (40, 150))
    assert small.leaves == 40 and large.leaves == 150
    node, same = [(0, 0), (1, 1), (2, 2)], 0
    while node:
        mine, theirs = node.pop()
        if small.left[mine] < 0:
            continue
        assert small.feature[mine] == large.feature[theirs]
        assert small.threshold[mine] == large.threshold[theirs]
        same += 1
        node.append((small.left[mine], large.left[theirs]))
        node.append((small.right[mine], large.right[theirs]))
    assert same == small.leaves - 3


def test_every_void_pattern_has_its_own_root_or_its_neighbours(kinks):
    tree = GROWERS["linear"](kinks, TreeLimits(50, 30, 20), 0)
    np.testing.assert_array_equal(tree.roots[:3], [0, 1, 2])
    # 0b110 and 0b010 differ in one cell.
    assert tree.roots[6] == 2 and set(tree.roots) == {0, 1, 2}


@pytest.fixture(scope="module")
def shards():
    """4,000 samples, log-uniform and uniform ones."""
    options = {"log-uniform": 1500, "uniform": 2500}
    return [
        generate(ShardOptions(count, 3, distribution=name), progress=False)
        for name, count in options.items()
    ]


def test_dataset_does_not_depend_on_how_it_is_split(shards, tmp_path):
    paths = []
    for number, shard in enumerate(shards):
        for first, past in ((0, 300), (300, 1400), (1400, len(shard.fine))):
            paths.append(tmp_path / f"{number}-{first}.h5")
            write_shard(paths[-1], shard.part(first, past))
    one, other = dataset_of(shards), open_dataset(paths[::-1])
    assert one.count == other.count == 4000
    for wanted in (1024, 2000, 4000):
        for mine, theirs in zip(one.subset(wanted), other.subset(wanted), strict=True):
            np.testing.assert_array_equal(mine, theirs)
    pieces = [d.learned([(0, 1300), (1300, 4000)]).position for d in (one, other)]
    np.testing.assert_array_equal(*pieces)
    assert len(pieces[0]) == 3800
    equal_models(*[train(data, QUICK, progress=False) for data in (one, other)])


def equal_models(one, other):
    for name, values in vars(one.forests).items():
        np.testing.assert_array_equal(values, getattr(other.forests, name))


def test_subset_is_spread_over_the_dataset(shards):
    data = dataset_of(shards)
    position = data.subset(2000).position
    assert len(position) == pytest.approx(2000 * 0.95, rel=0.05)
    assert position.min() < 2000 < 3000 < position.max()
    assert len(data.subset(10**9).position) == 3800
    assert not data.is_held_out(position).any()


def grown(data, training, workers=1):
    return dict(grow_trees(data, training, training.jobs, Ranks(), workers, progress=False))


def test_threads_and_jobs_give_the_same_trees_bit_for_bit(shards):
    data = dataset_of(shards)
    together = grown(data, QUICK, workers=3)
    for job in QUICK.jobs:
        ((_, alone),) = grow_trees(data, QUICK, [job], Ranks(), progress=False)
        for name, values in vars(alone).items():
            np.testing.assert_array_equal(values, getattr(together[job], name))
    equal_models(*[train(data, QUICK, workers, progress=False) for workers in (1, 3)])


def test_trees_of_a_forest_differ(shards):
    trees = grown(dataset_of(shards), QUICK)
    assert not np.array_equal(trees[0].threshold[:50], trees[1].threshold[:50])


def test_thinned_dataset_keeps_the_proportions(shards):
    part = dataset_of(shards).thinned(800)
    assert [settings.count for settings in part.settings] == [300, 500]
    assert part.count == 800 and len(next(part.read([(0, 800)])).young) == 300


def test_too_few_rows_for_the_depth_are_told(shards, caplog):
    model = train(shards, replace(QUICK, max_leaves=30_000))
    assert "too few for trees of depth 20 with 30,000 leaves of 30 rows each" in caplog.text
    assert model.scores["leaves"] < 4 * 30_000
    caplog.clear()
    train(shards, replace(QUICK, max_leaves=30))
    assert "too few" not in caplog.text


def test_too_few_samples_are_refused():
    with pytest.raises(UserError, match="generate more"):
        train([generate(ShardOptions(3), progress=False)], progress=False)


@pytest.mark.parametrize(
    "wrong",
    [
        {"trees": 0},
        {"max_leaves": 0},
        {"transform": "cube"},
        {"grower": "oak"},
        {"prior": 0.0},
        {"seed": -1},
    ],
)
def test_impossible_parameters_are_refused(shards, wrong):
    with pytest.raises(UserError):
        train(shards, TrainingOptions(**wrong), progress=False)


def test_trees_grown_apart_are_refused_where_they_do_not_fit(shards, tmp_path):
    data = dataset_of(shards)
    trees = grown(data, QUICK)
    parameters = parameters_of(data, QUICK)
    paths = [tmp_path / f"{job}.h5" for job in QUICK.jobs]
    for job, path in zip(QUICK.jobs, paths, strict=True):
        save_tree(path, trees[job], job, parameters, Spent(2.0, 1.5))
    found, spent = load_trees(paths[::-1], parameters)
    assert spent == Spent(8.0, 6.0)
    for job in QUICK.jobs:
        for name, values in vars(trees[job]).items():
            np.testing.assert_array_equal(values, getattr(found[job], name))
    for chosen, changed, message in (
        (paths[:-1], {}, "tree 3 is missing"),
        ([*paths, paths[0]], {}, "another file"),
        (paths, {"min_leaf": 7}, "min_leaf 30 where 7"),
        (paths, {"samples": []}, "other samples"),
    ):
        with pytest.raises(UserError, match=message):
            load_trees(chosen, parameters | changed)
    paths[0].write_bytes(paths[0].read_bytes()[:-100])
    with pytest.raises(UserError):
        load_trees(paths, parameters)
