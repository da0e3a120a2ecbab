"""Processes that are no ranks of a job: alone, and apart from each other."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from tests.patience import HANG_SECONDS

DIRECTORY = "OMPI_MCA_orte_top_session_dir"
CHILD = f"""
import carillon, os
from mpi4py import MPI
print(os.environ["{DIRECTORY}"], MPI.COMM_WORLD.size)
"""
PARENT = f"""
import os, subprocess, sys
from carillon import step
step.keep_apart(os.environ, os.getpid())
from mpi4py import MPI
print(os.environ["{DIRECTORY}"], MPI.COMM_WORLD.size, flush=True)
subprocess.run([sys.executable, "-c", sys.argv[1]], check=True)
"""


def printed(**variables: str) -> list[tuple[str, ...]]:
    """What a process and one that it starts say of their directories, and of how many they are."""
    done = subprocess.run(
        [sys.executable, "-c", PARENT, CHILD],
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
        check=True,
        timeout=HANG_SECONDS,
    )
    return [tuple(line.split()) for line in done.stdout.splitlines()]


def test_each_process_has_a_directory_of_its_own_and_leaves_none(tmp_path):
    (first, size), (second, another) = printed(TMPDIR=str(tmp_path))
    assert size == another == "1" and first != second
    assert {Path(each).parent for each in (first, second)} == {tmp_path}
    assert list(tmp_path.iterdir()) == []


def test_a_directory_that_the_user_has_chosen_stays(tmp_path):
    chosen = str(tmp_path / "chosen")
    assert [directory for directory, _ in printed(**{DIRECTORY: chosen})] == [chosen, chosen]
