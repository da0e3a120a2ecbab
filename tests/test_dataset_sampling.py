"""Samples depend on seed and number alone, and cover what real objects are made of."""

import numpy as np
import pytest

from carillon.errors import UserError
from dataset_gen.sampling import (
    HYPERCUBE,
    YOUNG_MAX,
    Mixture,
    hypercube,
    orient,
    pattern_classes,
    samples,
    shard_range,
)


def test_samples_do_not_depend_on_how_the_range_is_cut():
    whole = samples(3, 0, 2500)
    parts = [samples(3, a, b) for a, b in [(0, 1), (1, 1023), (1023, 1025), (1025, 2500)]]
    np.testing.assert_array_equal(whole, np.concatenate(parts))


def test_seeds_and_hypercubes_differ():
    assert not np.array_equal(hypercube(0, 0), hypercube(0, 1))
    assert not np.array_equal(hypercube(0, 0), hypercube(1, 0))


def test_hypercube_is_latin_before_it_is_oriented():
    plain = Mixture(void=0.0, uniform=0.0, two_phase=0.0, blended=0.0)
    values = np.sort(hypercube(0, 0, plain).ravel())
    strata = np.floor(values / YOUNG_MAX * HYPERCUBE).astype(int)
    np.testing.assert_array_equal(np.bincount(strata, minlength=HYPERCUBE), 8)


def test_neighbours_of_the_origin_are_ordered_and_moduli_in_range():
    young = samples(1, 0, 4096)
    assert (young[:, 1] <= young[:, 2]).all() and (young[:, 2] <= young[:, 4]).all()
    assert (young >= 0).all() and (young <= YOUNG_MAX).all()
    assert young.any(axis=1).all()


def test_orienting_is_a_symmetry_of_the_block():
    """It keeps the origin, its neighbours and its diagonals among themselves."""
    young = np.random.default_rng(0).uniform(size=(50, 8))
    turned = orient(young)
    for cells in ([0], [1, 2, 4], [3, 5, 6], [7]):
        np.testing.assert_array_equal(np.sort(young[:, cells]), np.sort(turned[:, cells]))
    # Each neighbour keeps the face diagonal opposite to it.
    opposite = [young[:, cell] + 10 * young[:, 7 ^ cell] for cell in (1, 2, 4)]
    after = [turned[:, cell] + 10 * turned[:, 7 ^ cell] for cell in (1, 2, 4)]
    np.testing.assert_array_equal(np.sort(opposite, axis=0), np.sort(after, axis=0))


def test_pattern_classes_partition_all_255_patterns():
    classes = pattern_classes()
    assert len(classes) == 21
    np.testing.assert_array_equal(np.sort(np.concatenate(classes)), np.arange(1, 256))
    assert classes[-1].tolist() == [255]


def test_one_hypercube_holds_every_kind_of_block():
    young = hypercube(0, 0)
    filled = young > 0
    contrast = young.max(axis=1) / np.where(filled, young, np.inf).min(axis=1)
    uniform = contrast == 1.0
    masks = filled @ (1 << np.arange(8))
    several = filled.sum(axis=1) > 1
    class_of = {int(mask): k for k, masks in enumerate(pattern_classes()) for mask in masks}
    assert {class_of[int(mask)] for mask in masks} == set(range(21))
    assert 0.4 < (~filled.all(axis=1)).mean() < 0.6
    assert {class_of[int(mask)] for mask in masks[uniform]} == set(range(21))
    assert ((contrast > 1) & (contrast < 1.01) & several).sum() > 20
    assert (contrast > 100).sum() > 20


@pytest.mark.parametrize("shards", [1, 2, 3, 7, 10])
def test_shards_cover_all_samples_once(shards):
    ranges = [shard_range(10, shard, shards) for shard in range(shards)]
    assert [i for start, stop in ranges for i in range(start, stop)] == list(range(10))


@pytest.mark.parametrize("split", [(0, 0, 1), (10, 1, 1), (10, -1, 2), (3, 0, 4), (3, 0, 0)])
def test_impossible_splits_are_refused(split):
    with pytest.raises(UserError):
        shard_range(*split)
