"""Partials of clips find modes of a solid; modes between them stay silent."""

from dataclasses import replace

import numpy as np
import pytest

from sound.clips.targets import Targets
from sound.design.assignment import SolidSpectrum, assigned, placed
from sound.design.objective import Objective
from sound.project.settings import Weights


def targets_of(hertz, amplitudes=None):
    hertz = np.array(hertz)
    own = np.ones((1, len(hertz))) if amplitudes is None else np.array([amplitudes])
    return Targets(("one",), hertz, np.full(len(hertz), 8.0), own, (np.zeros(1),), (44_100,))


def spectrum(hertz, pushed=None):
    hertz = np.array(hertz)
    return SolidSpectrum(hertz, np.ones((1, len(hertz))) if pushed is None else np.array([pushed]))


def found(targets, solid):
    return assigned(targets, targets.shares, solid)


def test_a_solid_whose_modes_are_the_partials_has_each_in_turn():
    aims = found(targets_of([440.0, 1212.0, 2376.0]), spectrum([100.0, 275.5, 540.0, 900.0]))
    np.testing.assert_allclose(aims.frequencies, [440.0, 1212.0, 2376.0])
    assert not aims.silent.any() and len(aims.left_out) == 0


def test_modes_that_no_strike_moves_are_passed_over():
    """As those of a bar that bend the other way."""
    solid = spectrum([100.0, 140.0, 275.0, 390.0, 540.0], [1.0, 1e-9, 1.0, 1e-9, 1.0])
    aims = found(targets_of([440.0, 1210.0, 2376.0]), solid)
    np.testing.assert_array_equal(aims.silent, [False, True, False, True, False])
    np.testing.assert_array_equal(aims.sounding, [0, 2, 4])
    assert (np.diff(aims.frequencies) > 0.0).all()
    assert (aims.amplitudes[0] > 0.0).tolist() == [True, False, True, False, True]
    assert (aims.dampings[aims.silent] > 8.0).all()


def test_a_pair_of_equal_modes_has_a_partial_for_each_way_in_which_strikes_push_it():
    hertz, aims = np.array([100.0, 200.0, 200.0, 400.0]), targets_of([300.0, 600.0, 1200.0])
    one = found(aims, SolidSpectrum(hertz, np.ones((1, 4))))
    np.testing.assert_array_equal(one.silent, [False, False, True, False])
    np.testing.assert_allclose(one.frequencies, [300.0, 600.0, 600.0, 1200.0])
    twice = replace(aims, names=("one", "other"), amplitudes=np.ones((2, 3)))
    alike = found(twice, SolidSpectrum(hertz, np.ones((2, 4))))
    np.testing.assert_array_equal(alike.silent, one.silent)
    across = np.array([[1.0, 1.0, 1.0, 1.0], [1.0, 1.0, -1.0, 1.0]])
    both = found(twice, SolidSpectrum(hertz, across))
    assert not both.silent.any()
    np.testing.assert_allclose(both.frequencies, [300.0, 600.0, 600.0, 1200.0])


def test_a_quiet_partial_that_no_mode_is_near_is_left_out():
    aims = found(targets_of([300.0, 1000.0, 5000.0], [1.0, 1.0, 0.02]), spectrum([30.0, 100.0]))
    np.testing.assert_allclose(aims.frequencies, [300.0, 1000.0])
    np.testing.assert_allclose(aims.left_out, [5000.0])
    assert 0.0 < aims.left_out_share < 0.2


def test_one_partial_has_a_silent_mode_beside_it():
    aims = found(targets_of([2422.0]), spectrum([100.0, 216.0, 300.0]))
    assert len(aims.frequencies) == 2 and aims.sounding.tolist() == [0]


@pytest.mark.parametrize("factor", [1.0, 3.7])
def test_the_size_of_the_solid_does_not_matter(factor):
    solid = np.array([100.0, 130.0, 275.0, 400.0, 610.0])
    aims = found(targets_of([440.0, 1210.0, 2376.0]), spectrum(factor * solid))
    np.testing.assert_array_equal(
        aims.silent, found(targets_of([440.0, 1210.0, 2376.0]), spectrum(solid)).silent
    )


def test_silent_modes_move_with_the_partials_beside_them():
    solid, silent = np.array([90.0, 100.0, 150.0, 200.0, 240.0]), np.array([1, 0, 1, 0, 1], bool)
    hertz = placed(solid, np.array([0.0, 200.0, 0.0, 800.0, 0.0]), silent)
    np.testing.assert_allclose(hertz[[1, 3]], [200.0, 800.0])
    np.testing.assert_allclose(hertz[[0, 4]], [180.0, 960.0])
    assert 200.0 < hertz[2] < 800.0


def test_frequencies_of_silent_modes_cost_nothing_and_their_loudness_does():
    solid = spectrum([100.0, 140.0, 275.0], [1.0, 1e-9, 1.0])
    aims = found(targets_of([440.0, 1210.0]), solid)
    objective = Objective(aims, Weights())
    eigenvalues = np.array([100.0, 140.0, 275.0]) ** 2
    moved = np.array([100.0, 200.0, 275.0]) ** 2
    pushed, loud = np.array([[1.0, 0.0, 1.0]]), np.array([[1.0, 1.0, 1.0]])
    cost = objective.cost(eigenvalues, pushed, 0.0)
    assert cost.frequency == objective.cost(moved, pushed, 0.0).frequency < 1e-20
    assert objective.cost(moved, loud, 0.0).amplitude > 0.4
