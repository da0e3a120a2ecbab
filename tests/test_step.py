"""Processes that are no ranks of a job: alone, and apart from each other."""

import os
from pathlib import Path

import pytest

from carillon.processes import mpi_environment
from tests.programs import python

DIRECTORY = "OMPI_MCA_orte_top_session_dir"
CHILD = f"""
import carillon, os
from mpi4py import MPI
print(os.environ["{DIRECTORY}"], MPI.COMM_WORLD.size)
"""
PARENT = f"""
import os, subprocess, sys
from carillon.processes import mpi_environment
mpi_environment.keep_apart(os.environ, os.getpid())
from mpi4py import MPI
print(os.environ["{DIRECTORY}"], MPI.COMM_WORLD.size, flush=True)
subprocess.run([sys.executable, "-c", sys.argv[1]], check=True)
"""


def printed(**variables: str) -> list[tuple[str, ...]]:
    """What a process and one that it starts say of their directories, and of how many they are."""
    done = python("-c", PARENT, CHILD, env={**os.environ, **variables}, check=True)
    return [tuple(line.split()) for line in done.stdout.splitlines()]


def test_each_process_has_a_directory_of_its_own_and_leaves_none(tmp_path):
    (first, size), (second, another) = printed(TMPDIR=str(tmp_path))
    assert size == another == "1" and first != second
    assert {Path(each).parent for each in (first, second)} == {tmp_path}
    assert list(tmp_path.iterdir()) == []


def test_a_directory_that_the_user_has_chosen_stays(tmp_path):
    chosen = str(tmp_path / "chosen")
    assert [directory for directory, _ in printed(**{DIRECTORY: chosen})] == [chosen, chosen]


REMOTE = {
    "OMPI_COMM_WORLD_SIZE": "2",
    "OMPI_COMM_WORLD_LOCAL_SIZE": "1",
    "SLURM_STEP_NUM_NODES": "1",
}
"""Variables of a rank that `mpiexec` starts on another node, by a step of that node alone."""


@pytest.mark.parametrize(
    "chosen", [{"OMPI_MCA_pml": "cm"}, {"PMIX_RANK": "0"}, {"OMPI_COMM_WORLD_SIZE": "2"}, REMOTE]
)
def test_ranks_and_users_choose_their_network(chosen):
    environment = dict(chosen)
    with mpi_environment.without_networks(environment):
        assert environment == chosen
    assert environment == chosen


@pytest.mark.parametrize("chosen", [{"OMPI_MCA_pml": "ob1"}, {"OMPI_MCA_btl": "tcp,self"}])
def test_what_a_user_chooses_of_a_network_is_all_that_is_chosen(chosen):
    environment = dict(chosen)
    with mpi_environment.without_networks(environment):
        assert environment == {"OMPI_MCA_pml": "ob1", "OMPI_MCA_btl": "self", **chosen}
    assert environment == chosen


def test_what_a_lone_process_starts_looks_for_networks():
    look = "import os; print(os.environ.get('OMPI_MCA_pml'))"
    lone = (
        "import os, subprocess, sys\n"
        "from carillon.processes import mpi_environment\n"
        "with mpi_environment.without_networks(os.environ):\n"
        "    from mpi4py import MPI\n"
        "print(MPI.COMM_SELF.sendrecv('itself', 0), flush=True)\n"
        f"subprocess.run([sys.executable, '-c', {look!r}], check=True)\n"
    )
    done = python("-c", lone, check=True)
    assert done.stdout.split() == ["itself", "None"]


def warned(**variables: str) -> str:
    """What a command says that was started with these variables."""
    done = python(
        "-m", "carillon", "environment", "--json", env={**os.environ, **variables}, check=True
    )
    return done.stderr


SLURM = {"SLURM_JOB_ID": "77", "SLURM_STEP_ID": "0", "SLURM_STEP_NUM_TASKS": "2"}


@pytest.mark.parametrize(
    ("variables", "who", "remedy"),
    [
        ({**SLURM, "SLURM_PROCID": "1"}, "task 1 of 2 of a Slurm step", "srun --mpi=pmix"),
        ({"PMI_SIZE": "3", "PMI_RANK": "2"}, "rank 2 of 3", "the mpiexec of the MPI"),
    ],
    ids=["srun without PMIx", "mpiexec of another MPI"],
)
def test_one_of_several_processes_that_do_not_find_each_other_says_so(variables, who, remedy):
    said = warned(**variables)
    assert f"warning: this process is {who}, but MPI finds no other" in said and remedy in said


def test_a_process_that_was_started_alone_has_nothing_to_say():
    assert "MPI finds no other" not in warned(**{**SLURM, "SLURM_STEP_NUM_TASKS": "1"})
    assert (
        mpi_environment.lonely_among({"SLURM_NTASKS": "4", "SLURM_JOB_ID": "7"}) is None
    )  # a batch script
