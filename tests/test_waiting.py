"""Ranks that share cores sleep while they wait, others do not, and messages arrive as before."""

import json

import pytest
from mpi4py import MPI

from carillon.processes.waiting import leave_cores

PROGRAM = """
import json, os, sys, time
from mpi4py import MPI
from carillon.processes.waiting import leave_cores
comm = MPI.COMM_WORLD
if sys.argv[1] == "share":
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
sleeps = [leave_cores(comm), leave_cores(comm)]
began, used = time.perf_counter(), time.process_time()
if comm.rank == 0:
    comm.recv(source=1)
else:
    time.sleep(1.0)
    comm.send(None, dest=0)
spent = (time.process_time() - used) / (time.perf_counter() - began)
total = sum(comm.allreduce(number) for number in range(100))
found = comm.gather({"sleeps": sleeps, "spent": spent, "total": total})
if comm.rank == 0:
    print(json.dumps(found))
"""


def test_a_rank_alone_waits_for_nobody():
    assert not leave_cores(MPI.COMM_WORLD)


class Machine:
    """Two ranks, each bound to some cores."""

    size = 2

    def __init__(self, *bound):
        self.bound = bound

    def Split_type(self, kind):  # noqa: N802
        return self

    def allgather(self, mine):
        return self.bound

    def Free(self):  # noqa: N802
        pass


def test_ranks_with_cores_of_their_own_do_not_sleep(monkeypatch):
    monkeypatch.delenv("OMPI_MCA_mpi_yield_when_idle", raising=False)
    assert not leave_cores(Machine({0}, {1}))
    assert not leave_cores(Machine({0, 1}, {0, 1}))


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("how", "asked"), [("share", "0"), pytest.param("as they are", "1", marks=pytest.mark.nightly)]
)
def test_ranks_that_share_cores_sleep_while_they_wait(how, asked, mpiexec, tmp_path):
    if "Open MPI" not in MPI.Get_library_version():
        pytest.skip("another MPI waits in its own way")
    script = tmp_path / "waits.py"
    script.write_text(PROGRAM)
    variables = {"OMPI_MCA_mpi_yield_when_idle": asked}
    found = json.loads(mpiexec(2, script, how, env=variables, check=True).stdout)
    for rank in found:
        assert rank["sleeps"] == [True, True]
        assert rank["total"] == 2 * sum(range(100))
    # One that looks for messages without a pause takes all of a core.
    assert found[0]["spent"] < 0.7
