"""Every rank holds its share of the solid, and the shares give what the whole would give."""

from pathlib import Path

import h5py
import numpy as np
import pytest

pytestmark = pytest.mark.mpi

PROGRAM = Path(__file__).with_name("distributed_checks.py")
EVERYWHERE = [
    "shares_make_up_the_solid",
    "ranks_share_the_cores_they_have_together",
    "products_are_those_of_the_whole_matrices",
    "synthesis_bounds_the_spectrum",
    "shared_merges_are_those_of_one_rank",
]
SOME = [
    "arrays_arrive_as_they_were",
    "messages_counted_are_messages_sent",
    "ranks_send_each_other_a_message_up_and_one_down_for_a_merge",
    "exchanges_leave_the_modes_as_they_are",
    "groups_that_do_not_touch_can_be_merged",
]
FEW = [
    "a_share_is_no_larger_than_its_part_of_the_mesh",
    "shared_eigenpairs_are_those_of_lapack",
    "failure_of_shared_eigenpairs_is_told",
]
FIRST = [
    "only_the_first_rank_holds_arrays_of_the_length_of_the_mesh",
    "failure_of_the_writer_is_everyones",
    "bad_input_is_everyones",
]
CHECKS = {
    1: EVERYWHERE + SOME,
    2: EVERYWHERE + FEW,
    3: EVERYWHERE + SOME + FIRST,
    4: EVERYWHERE + FEW,
    7: EVERYWHERE,
}
"""By number of ranks; all of one number in one start, which takes longer than any of them."""


@pytest.mark.parametrize(
    "ranks",
    [each if each in (2, 3) else pytest.param(each, marks=pytest.mark.nightly) for each in CHECKS],
)
def test_checks(ranks, mpiexec):
    mpiexec(ranks, PROGRAM, ",".join(CHECKS[ranks]), check=True)


@pytest.mark.nightly
def test_file_is_the_same_however_many_columns_travel_together(mpiexec, tmp_path):
    name = "modes_are_the_same_however_many_columns_travel_together"
    mpiexec(3, PROGRAM, name, tmp_path, check=True)
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
