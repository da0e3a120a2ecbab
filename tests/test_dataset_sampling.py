"""Samples depend on seed and number alone, and cover what real objects are made of."""

import numpy as np
import pytest

from carillon.errors import UserError
from dataset_gen.sampling import (
    DISTRIBUTIONS,
    HYPERCUBE,
    Mixture,
    Moduli,
    hypercube,
    moduli,
    orient,
    pattern_classes,
    samples,
    shard_range,
)

EVERY = pytest.mark.parametrize("drawn", [moduli(name) for name in DISTRIBUTIONS], ids=str)
PLAIN = Mixture(void=0.0, uniform=0.0, two_phase=0.0, blended=0.0)


def only(kind):
    """A mixture without void cells that is all of one kind."""
    return Mixture(**{"void": 0.0, "uniform": 0.0, "two_phase": 0.0, "blended": 0.0, kind: 1.0})


@EVERY
def test_samples_do_not_depend_on_how_the_range_is_cut(drawn):
    whole = samples(3, 0, 2500, drawn)
    parts = [samples(3, a, b, drawn) for a, b in [(0, 1), (1, 1023), (1023, 1025), (1025, 2500)]]
    np.testing.assert_array_equal(whole, np.concatenate(parts))


def test_seeds_and_hypercubes_differ():
    assert not np.array_equal(hypercube(0, 0), hypercube(0, 1))
    assert not np.array_equal(hypercube(0, 0), hypercube(1, 0))


@pytest.mark.parametrize(
    "drawn", [moduli("uniform"), moduli("uniform", 2, 5), moduli("log-uniform")], ids=str
)
def test_hypercube_is_latin_on_its_scale_before_it_is_oriented(drawn):
    values = np.sort(hypercube(0, 0, drawn, PLAIN).ravel())
    if drawn.logarithmic:
        unit = np.log(values / drawn.low) / np.log(drawn.high / drawn.low)
    else:
        unit = (values - drawn.low) / (drawn.high - drawn.low)
    strata = np.floor(unit * HYPERCUBE).astype(int)
    np.testing.assert_array_equal(np.bincount(strata, minlength=HYPERCUBE), 8)


@EVERY
def test_neighbours_of_the_origin_are_ordered_and_moduli_in_range(drawn):
    young = samples(1, 0, 4096, drawn)
    assert (young[:, 1] <= young[:, 2]).all() and (young[:, 2] <= young[:, 4]).all()
    filled = young[young > 0]
    assert (filled >= drawn.low).all() and (filled <= drawn.high).all()
    assert young.any(axis=1).all()


def test_log_uniform_moduli_are_even_over_five_decades():
    values = np.log10(samples(0, 0, 8 * HYPERCUBE, moduli("log-uniform"), PLAIN))
    assert values.min() < -1.99 and values.max() > 2.99
    # Turning a block mixes the other cells, but leaves the origin and the one opposite to it.
    for cell in (0, 7):
        counts = np.bincount((values[:, cell] + 2).astype(int), minlength=5)
        np.testing.assert_allclose(counts, 8 * HYPERCUBE / 5, atol=8)
    counts = np.histogram(values, bins=np.linspace(-2, 3, 51))[0]
    np.testing.assert_allclose(counts, 64 * HYPERCUBE / 50, rtol=0.01)


@pytest.mark.parametrize(
    "drawn",
    [
        moduli("uniform"),
        moduli("uniform", 4, 5),
        moduli("log-uniform"),
        moduli("log-uniform", 1, 9),
    ],
    ids=str,
)
def test_every_kind_of_block_stays_in_range(drawn):
    for kind in ("uniform", "two_phase", "blended"):
        young = hypercube(2, 0, drawn, only(kind))
        filled = young[young > 0]
        assert (filled >= drawn.low).all() and (filled <= drawn.high).all()
        distinct = [len(set(block[block > 0])) for block in young]
        assert max(distinct) == {"uniform": 1, "two_phase": 2, "blended": 8}[kind]


def test_two_phases_reach_every_contrast_of_the_range():
    uniform = hypercube(2, 0, moduli("uniform"), only("two_phase"))
    contrast = uniform.max(axis=1) / uniform.min(axis=1)
    assert 800 < contrast.max() <= 1000
    logarithmic = hypercube(2, 0, moduli("log-uniform"), only("two_phase"))
    contrast = logarithmic.max(axis=1) / logarithmic.min(axis=1)
    assert 2e4 < contrast.max() <= 1e5


def test_blended_blocks_approach_their_mean_on_the_scale_of_the_distribution():
    drawn = moduli("log-uniform")
    blended = np.log(hypercube(2, 0, drawn, only("blended")))
    plain = np.log(hypercube(2, 0, drawn, PLAIN))
    np.testing.assert_allclose(
        np.sort(blended.mean(axis=1)), np.sort(plain.mean(axis=1)), rtol=1e-9, atol=1e-9
    )
    spread = blended.std(axis=1) / plain.std(axis=1).mean()
    assert spread.min() < 3e-3 and spread.max() > 0.5


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("normal",), "unknown"),
        (("uniform", 5, 5), "low < high"),
        (("uniform", 6, 5), "low < high"),
        (("uniform", -1, 5), "or low 0"),
        (("uniform", float("nan"), 5), "low < high"),
        (("uniform", 0, float("nan")), "low < high"),
        (("uniform", 0, float("inf")), "high up to"),
        (("uniform", 1e-12, 5), "or low 0"),
        (("log-uniform", 0, 5), "above 0"),
        (("log-uniform", 1e-3, 1e6), "times as large"),
    ],
)
def test_impossible_ranges_are_refused(arguments, message):
    with pytest.raises(UserError, match=message):
        moduli(*arguments)


def test_default_ranges_are_those_of_the_distribution():
    assert moduli() == Moduli("uniform", 0.0, 10.0)
    assert moduli("log-uniform", high=10) == Moduli("log-uniform", 0.01, 10.0)


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
