"""Every rank holds its share of the solid, and the shares give what the whole would give."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

pytestmark = pytest.mark.mpi

PROGRAM = Path(__file__).with_name("distributed_checks.py")
RANKS = (1, 2, 3, 4, 7)


@pytest.fixture
def check(mpiexec):
    def run(ranks: int, names: list[str], *arguments: object) -> None:
        mpiexec(ranks, PROGRAM, ",".join(names), *arguments, check=True)

    return run


@pytest.mark.parametrize("ranks", RANKS)
def test_shares_give_what_the_whole_would_on_any_number_of_ranks(ranks, check):
    names = [
        "shares_make_up_the_solid",
        "products_are_those_of_the_whole_matrices",
        "synthesis_bounds_the_spectrum",
    ]
    check(ranks, names)


@pytest.mark.parametrize("ranks", [2, 4])
def test_share_is_no_larger_than_its_part_of_the_mesh(ranks, check):
    check(ranks, ["a_share_is_no_larger_than_its_part_of_the_mesh"])


def test_only_the_first_rank_holds_arrays_of_the_length_of_the_mesh(check):
    check(3, ["only_the_first_rank_holds_arrays_of_the_length_of_the_mesh"])


@pytest.mark.parametrize("ranks", [1, 3])
def test_messages_arrive_and_are_counted(ranks, check):
    check(ranks, ["arrays_arrive_as_they_were", "messages_counted_are_messages_sent"])


def test_error_of_the_first_rank_leaves_none_waiting(check):
    check(3, ["failure_of_the_writer_is_everyones", "bad_input_is_everyones"])


@pytest.mark.parametrize("ranks", [1, 3])
def test_groups_that_do_not_touch_can_be_merged(ranks, check):
    check(ranks, ["groups_that_do_not_touch_can_be_merged"])


def test_file_is_the_same_however_many_columns_travel_together(check, tmp_path):
    check(3, ["modes_are_the_same_however_many_columns_travel_together"], tmp_path)
    files = sorted(tmp_path.glob("*.h5"))
    assert len(files) == 4
    contents = []
    for path in files:
        with h5py.File(path) as file:
            assert file["modes"].fletcher32
            assert file["modes"].chunks == (file["modes"].shape[0], 16)
            contents.append(file["modes"][()])
    for other in contents[1:]:
        assert np.array_equal(other, contents[0])
