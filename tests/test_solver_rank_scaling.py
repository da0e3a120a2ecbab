"""The modelled speed-up of block Lanczos on many ranks: its bounds, and what was measured."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.linear.panels import STRIP
from solver.rank_scaling import (
    PANEL,
    factorisation,
    modelled_seconds,
    solves,
    speed_up,
    thread_speed_up,
)

MEASURED = {
    (78_462, 1): 7.1,
    (78_462, 2): 6.7 / 2 * 1.02,
    (78_462, 4): 9.2 / 4 * 1.13,
    (251_091, 1): 47.0,
    (251_091, 2): 52.0 / 2 * 1.05,
    (251_091, 4): 59.0 / 4 * 1.17,
}
"""Processor seconds of the busiest rank by unknowns and ranks, 64 modes of a bunny: those of all
ranks over their number, times the busiest one's over the mean ("By ranks and nodes" in
docs/results/measured.md)."""
COUNTED = {
    (78_462, 1): 1.31e11,
    (78_462, 2): 5.98e10,
    (78_462, 4): 2.70e10,
    (78_462, 8): 9.16e9,
    (78_462, 16): 3.43e9,
    (251_091, 1): 1.36e12,
    (251_091, 2): 6.64e11,
    (251_091, 4): 3.18e11,
    (251_091, 8): 9.91e10,
}
"""Operations of the rank that has most in fronts of its own, counted by `RankTree.plan`."""
COUNTED_OF_SOLVE = {78_462: 2.73e8, 251_091: 1.37e9}
"""The same of a solve on one rank."""
UNKNOWNS, MODES = st.floats(1e3, 1e7), st.integers(7, 1000)


@pytest.mark.parametrize("case", MEASURED)
def test_the_model_is_near_what_was_measured(case):
    unknowns, ranks = case
    seconds = sum(modelled_seconds(unknowns, 64, ranks).values())
    assert seconds == pytest.approx(MEASURED[case], rel=0.3)


@pytest.mark.parametrize("case", COUNTED)
def test_operations_are_near_those_that_the_solver_counts(case):
    assert factorisation(*case)[0].flops == pytest.approx(COUNTED[case], rel=0.3)


@pytest.mark.parametrize("unknowns", COUNTED_OF_SOLVE)
def test_operations_of_a_solve_are_near_those_that_the_solver_counts(unknowns):
    flops = solves(unknowns, 1, 1, 1).flops
    assert flops == pytest.approx(COUNTED_OF_SOLVE[unknowns], rel=0.15)


def test_panels_are_the_solvers_strips():
    assert PANEL == STRIP


@given(UNKNOWNS, MODES, st.integers(1, 1024), st.floats(0.0, 100.0))
def test_speed_up_is_never_above_the_ranks(unknowns, modes, ranks, alone):
    assert speed_up(unknowns, modes, 1, alone) == 1.0
    gain = speed_up(unknowns, modes, ranks)
    assert 0.0 < gain <= ranks * (1.0 + 1e-12)
    assert speed_up(unknowns, modes, ranks, alone) <= max(gain, 1.0) * (1.0 + 1e-12)


def test_more_ranks_are_faster_as_long_as_they_have_panels():
    gains = [speed_up(1e6, 64, 2**power) for power in range(11)]
    assert gains == sorted(gains)
    efficiencies = [gain / 2**power for power, gain in enumerate(gains)]
    assert efficiencies == sorted(efficiencies, reverse=True)


@pytest.mark.parametrize("ranks", [8, 64, 512])
def test_larger_solids_gain_more(ranks):
    gains = [speed_up(unknowns, 64, ranks) for unknowns in (3e4, 1e5, 3e5, 1e6, 3e6)]
    assert gains == sorted(gains)


@given(UNKNOWNS, MODES, st.integers(2, 1024), st.floats(1e-7, 1e-3), st.floats(1e7, 1e11))
def test_slower_networks_gain_less(unknowns, modes, ranks, latency, bandwidth):
    gain = speed_up(unknowns, modes, ranks, 0.0, latency, bandwidth)
    assert speed_up(unknowns, modes, ranks, 0.0, 2.0 * latency, bandwidth) < gain
    assert speed_up(unknowns, modes, ranks, 0.0, latency, 0.5 * bandwidth) < gain


def test_many_ranks_are_limited_by_the_fronts_that_they_share():
    seconds = modelled_seconds(1e6, 64, 1024)
    assert max(seconds, key=seconds.get) == "shared fronts"
    assert factorisation(1e6, 1)[1].flops == 0.0


def test_threads_of_a_rank_gain_less_than_ranks():
    assert thread_speed_up(1) == 1.0
    assert thread_speed_up(2) == pytest.approx(1.6)
    assert thread_speed_up(8) < speed_up(78_462, 64, 8)
