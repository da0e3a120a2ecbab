"""Of two processes that work on one result, the second is told so; locks die with their holders."""

import os
import subprocess
import sys

import pytest

from carillon.errors import UserError
from carillon.files.locks import locked
from tests.programs import CHECKOUT

HOLDER = """
import sys
from carillon.files.locks import locked
with locked(sys.argv[1]):
    print("held", flush=True)
    sys.stdin.read()
"""

PATIENT = """
import sys
from pathlib import Path
from carillon.files.locks import take
take(Path(sys.argv[1]), "", patient=True)
"""


@pytest.fixture
def holder(tmp_path):
    """Another process that holds `design.h5`."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(tmp_path / "design.h5")],
        cwd=CHECKOUT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.communicate()


def test_the_second_is_refused_in_one_sentence(holder, tmp_path):
    path = tmp_path / "design.h5"
    for _ in range(2):  # being refused takes nothing away from the holder
        with pytest.raises(UserError) as caught, locked(path):
            pass
        assert "design.h5: another process is working on it" in str(caught.value)
    with locked(tmp_path / "other.h5"):
        pass


def test_a_lock_is_gone_when_its_holder_has_finished(holder, tmp_path):
    holder.communicate("")
    assert holder.returncode == 0 and list(tmp_path.iterdir()) == []


def test_the_patient_wait_until_the_holder_has_ended(holder, tmp_path):
    waiting = subprocess.Popen(
        [sys.executable, "-c", PATIENT, str(tmp_path / ".design.h5.lock")],
        cwd=CHECKOUT,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert "is held by another process; waiting" in waiting.stderr.readline()
    assert waiting.poll() is None
    holder.kill()
    assert waiting.wait() == 0
    waiting.stderr.close()


def test_the_lock_of_a_killed_holder_is_taken_over_and_removed(holder, tmp_path):
    holder.kill()
    holder.wait()
    with locked(tmp_path / "design.h5"):
        pass
    assert list(tmp_path.iterdir()) == []


def test_an_exception_gives_the_lock_back(tmp_path):
    path = tmp_path / "design.h5"
    with pytest.raises(KeyboardInterrupt), locked(path):
        raise KeyboardInterrupt
    with locked(path):
        pass
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_file_is_not_taken_for_a_lock(tmp_path):
    os.mkfifo(tmp_path / ".design.h5.lock")
    with pytest.raises(UserError, match="is no regular file"), locked(tmp_path / "design.h5"):
        pass
    assert (tmp_path / ".design.h5.lock").is_fifo()


def test_a_lock_is_not_made_through_a_link(tmp_path):
    (tmp_path / ".design.h5.lock").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(UserError, match="cannot be written"), locked(tmp_path / "design.h5"):
        pass
    assert not (tmp_path / "elsewhere").exists()
