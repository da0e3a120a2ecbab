"""PETSc does not take a pipe that nobody reads any more for a crash."""

import os
import subprocess
import sys

import pytest

from tests.patience import HANG_SECONDS
from tests.programs import python

MODES = ("modes", "builtin:box", "--resolution", "6", "--modes", "9", "--json", "--out", "box.h5")


@pytest.mark.parametrize("both", [False, True])
def test_a_reader_of_modes_who_has_seen_enough_is_no_error(tmp_path, both):
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run(
        [sys.executable, "-m", "carillon", *MODES],
        cwd=tmp_path,
        stdout=write,
        stderr=write if both else subprocess.PIPE,
        text=True,
        timeout=HANG_SECONDS,
    )
    os.close(write)
    assert done.returncode == 0, done.stderr
    assert "PETSC" not in (done.stderr or "")
    assert (tmp_path / "box.h5").is_file()


def test_python_raises_what_it_does_without_petsc():
    program = "import os\nfrom carillon.processes.petsc import PETSc\nread, write = os.pipe()\n"
    program += "os.close(read)\ntry: os.write(write, b'x')\n"
    program += "except BrokenPipeError: print('told', PETSc.Sys.isInitialized())\n"
    done = python("-c", program)
    assert done.stdout.strip() == "told True", done.stderr
