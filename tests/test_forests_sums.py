"""Sums over rows: exact, so that neither order nor division matters."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from carillon.errors import UserError
from forests.training.exact_sums import FULL, SUMMED, Sums, bits_of

LEAVES = 3


def rows(seed, count=400):
    generator = np.random.default_rng(seed)
    features = generator.uniform(-15.0, 5.0, (count, 7)).astype(np.float32)
    weight = np.where(generator.random(count) < 0.1, 400.0, 1.0)
    leaf_numbers = generator.integers(0, LEAVES, count).astype(np.int32)
    return leaf_numbers, features, generator.standard_normal(count), weight


BITS = bits_of(True, 400.0)


def added(*parts, bits=BITS):
    sums = Sums.nothing(LEAVES, bits)
    for part in parts:
        sums.add(*part)
    sums.carry()
    return sums


def equal(one, other):
    return all(
        (mine == theirs).all()
        for (_, mine), (_, theirs) in zip(one.arrays(), other.arrays(), strict=True)
    )


@given(st.integers(0, 2**32), st.lists(st.integers(0, 400), max_size=4))
def test_any_order_and_division_gives_the_same_bits(seed, cuts):
    whole = rows(1)
    order = np.random.default_rng(seed).permutation(len(whole[0]))
    pieces = np.split(order, sorted(cuts))
    assert equal(added(whole), added(*(tuple(a[p] for a in whole) for p in pieces)))


@pytest.mark.parametrize("logarithmic", [True, False])
def test_sums_are_those_of_floating_point_numbers(logarithmic):
    leaf_numbers, features, target, weight = rows(2)
    values = added(rows(2), bits=bits_of(logarithmic, 400.0)).values()
    z = np.column_stack([features.astype(float), np.ones(len(target)), target])
    products = (weight[:, None, None] * z[:, :, None] * z[:, None, :])[:, *np.tril_indices(9)]
    for leaf in range(LEAVES):
        expected = products[leaf_numbers == leaf].sum(axis=0)[:SUMMED]
        tolerance = 1e-12 if logarithmic else 1e-5
        np.testing.assert_allclose(values[leaf, :SUMMED], expected, rtol=0, atol=tolerance * 1e5)


def test_huge_ratios_count_as_the_largest_one():
    leaf_numbers, features, target, weight = rows(3)
    features[0] = np.finfo(np.float32).max
    assert np.isfinite(added((leaf_numbers, features, target, weight), bits=-11).values()).all()


def test_sums_without_room_are_refused():
    sums = added(rows(4))
    sums.moments[1, 0, 5] = FULL
    with pytest.raises(UserError, match="no room left for more rows"):
        sums.values()
