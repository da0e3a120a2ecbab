"""Overlapping free cell ordering: the table of section 7.1.1, ties, and symmetry."""

import itertools

import numpy as np

from carillon.fem.block import symmetries
from dataset_gen.sampling import samples
from forests.ordering import FLIPS, order_code
from tests.forests_reference import cell_order_reference


def cell_order(young):
    """Cells e'1..e'8 (n, 8 origins, 8) of blocks (n, 8)."""
    flips = [[[0, *FLIPS[order_code(block, origin)]] for origin in range(8)] for block in young]
    return np.array(flips) ^ np.arange(8)[:, None]


def ordered_moduli(young):
    """Moduli e'1..e'8 (n, 8 origins, 8) of blocks (n, 8)."""
    return young[np.arange(len(young))[:, None, None], cell_order(young)]


def test_order_seen_from_every_origin_for_every_ranking_of_the_axes():
    for origin in range(8):
        for a, b, c in itertools.permutations((1, 2, 4)):
            young = np.full(8, 9.0)
            young[[origin ^ a, origin ^ b, origin ^ c]] = 1.0, 2.0, 3.0
            expected = [0, a, b, c, a ^ b, b ^ c, a ^ c, 7]
            found = cell_order(young[None])[0, origin]
            np.testing.assert_array_equal(found, origin ^ np.array(expected))


def test_complete_tie_goes_to_the_lower_axis():
    np.testing.assert_array_equal(cell_order(np.ones((1, 8)))[0, 0], [0, 1, 2, 4, 3, 6, 5, 7])


def test_tied_neighbours_are_told_apart_by_the_opposite_diagonals():
    young = np.array([[1.0, 2.0, 2.0, 5.0, 2.0, 7.0, 6.0, 1.0]])
    # Opposite to cells 1, 2, 4 are 6, 5, 3 with moduli 6, 7, 5: axes z, x, y.
    np.testing.assert_array_equal(cell_order(young)[0, 0], [0, 4, 1, 2, 5, 3, 6, 7])


def test_the_48_images_of_a_block_are_ordered_alike_ties_and_void_included():
    young = np.round(samples(4, 0, 300))  # whole GPa: many ties
    young = young[young.any(axis=1)]
    expected = ordered_moduli(young)
    for image in symmetries():
        moved = np.empty_like(young)
        moved[:, image] = young
        np.testing.assert_array_equal(ordered_moduli(moved)[:, image], expected)


def test_compiled_order_is_that_of_sorting():
    young = np.round(samples(5, 0, 2000))
    young = young[young.any(axis=1)]
    np.testing.assert_array_equal(cell_order(young), cell_order_reference(young))
