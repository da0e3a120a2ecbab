"""Two processes at one shard where locks keep nobody out: one goes on, nothing is spoilt.

So it is on a network file system that keeps locks to each machine or has none, when a node that was
cut off writes on while its job runs again on another.
"""

import errno
import fcntl
import os
import socket
import subprocess
import sys

import pytest

from carillon.errors import UserError
from carillon.files import locks
from dataset_gen import journal as journals
from dataset_gen.generate import generate_file
from dataset_gen.journal import Journal, journal_of
from dataset_gen.settings import ShardOptions, settings_of
from dataset_gen.shards import origin_of
from dataset_gen.tasks import ROW, ShardPlan, in_this_process
from tests.patience import HANG_SECONDS
from tests.programs import checkout_environment

SAMPLES, TASK, FIRST = 1500, 128, 3
PLAN = ShardPlan(settings_of(ShardOptions(SAMPLES, 4)), TASK)
WORK = [bytes([number]) * TASK * ROW.itemsize for number in range(4)]

PROGRAM = f"""
import errno, fcntl, sys
from carillon.command_line import exit_status
from dataset_gen import journal
from dataset_gen.generate import generate_file
from dataset_gen.settings import ShardOptions, settings_of
from dataset_gen.shards import origin_of
from dataset_gen.tasks import ShardPlan

path, locks, machine = sys.argv[1:]

def flock(*_):
    if locks == "none":
        raise OSError(errno.ENOLCK, "no locks")

def watched(plan, numbers):
    for number in numbers:
        if number == {FIRST}:
            print("begun", flush=True)
            sys.stdin.readline()
        yield plan.work(number)

def main():
    fcntl.flock = flock
    journal.machine = lambda: machine
    plan = ShardPlan(settings_of(ShardOptions({SAMPLES}, 4)), {TASK})
    generate_file(path, plan, origin_of(plan.settings, ShardOptions({SAMPLES})), watched)

if __name__ == "__main__":
    sys.exit(exit_status.run("program", main))
"""
"""Makes the shard; after some tasks it waits for a line."""


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """The bytes of the shard, made by one process."""
    path = tmp_path_factory.mktemp("reference") / "shard.h5"
    make(path)
    return path.read_bytes()


@pytest.fixture
def path(tmp_path):
    return tmp_path / "shard.h5"


def make(path, engine=in_this_process):
    return generate_file(path, PLAN, origin_of(PLAN.settings, ShardOptions(SAMPLES)), engine)


@pytest.fixture(params=["local", "none"])
def locking(request, monkeypatch):
    """Locks that are kept to each machine, or are none; this process is on a machine of its own."""

    def flock(*_):
        if request.param == "none":
            raise OSError(errno.ENOLCK, "no locks")

    monkeypatch.setattr(fcntl, "flock", flock)
    monkeypatch.setattr(journals, "machine", lambda: "here")
    return request.param


@pytest.fixture
def other(path, tmp_path_factory, locking):
    """A process on another machine, or on this one without locks, that has begun the shard."""
    program = tmp_path_factory.mktemp("program") / "program.py"
    program.write_text(PROGRAM)
    machine = "there" if locking == "local" else "here"
    process = subprocess.Popen(
        [sys.executable, str(program), str(path), locking, machine],
        env=checkout_environment(),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "begun\n"
    yield process
    process.kill()
    process.communicate()


def go_on(process: subprocess.Popen[str]) -> str:
    """Let the other process go on; what it says at its end."""
    _, said = process.communicate("\n", timeout=HANG_SECONDS)
    return said.splitlines()[-1] if said else ""


def test_the_second_goes_on_with_what_the_first_has_done(path, other, reference):
    assert make(path) == SAMPLES - FIRST * TASK
    assert path.read_bytes() == reference
    go_on(other)
    assert path.read_bytes() == reference
    assert list(path.parent.iterdir()) == [path]


def test_the_first_is_refused_with_the_name_of_the_second_which_finishes(path, other, reference):
    said = []

    def interrupted(plan, numbers):
        for number in numbers:
            if number == FIRST + 2:
                said.append(go_on(other))
            yield plan.work(number)

    assert make(path, interrupted) == SAMPLES - FIRST * TASK
    owner = f"process {os.getpid()} on {socket.gethostname()} has taken it over"
    assert other.returncode == 2 and owner in said[0]
    assert path.read_bytes() == reference
    assert list(path.parent.iterdir()) == [path]


def test_bytes_that_a_cut_off_machine_writes_late_spoil_nothing(path, locking, monkeypatch):
    first = Journal(path, PLAN, {})
    first.append(WORK[0])
    monkeypatch.setattr(journals, "machine", lambda: "elsewhere")
    second = Journal(path, PLAN, {})
    second.append(WORK[1])
    # What was under way when the first was asked last, and what it would cut off.
    first._append(b"TASK", WORK[3])
    os.ftruncate(first._file, first._end)
    with pytest.raises(UserError, match=r"process \d+ on .* has taken it over"):
        first.append(WORK[3])
    first.close(remove=True)
    second.append(WORK[2])
    assert list(second.work()) == WORK[:3]
    second.close()
    third = Journal(path, PLAN, {})
    assert list(third.work()) == WORK[:3]
    third.close(remove=True)
    assert list(path.parent.iterdir()) == []


def test_of_two_that_begin_at_once_one_goes_on(path, locking, monkeypatch):
    others = []

    def take(name, refusal, patient=False, take=journals.take):
        file = take(name, refusal, patient)
        if not others:
            others.append(None)
            others[:] = [Journal(path, PLAN, {})]
        return file

    monkeypatch.setattr(journals, "take", take)
    last = Journal(path, PLAN, {})
    with pytest.raises(UserError, match="has taken it over"):
        others[0].append(WORK[0])
    last.append(WORK[1])
    assert list(last.work()) == WORK[1:2]


def test_a_journal_that_this_machine_s_locks_keep_is_not_copied(path):
    files = set()
    for _ in range(3):
        journal = Journal(path, PLAN, {})
        files.add(journal_of(path).stat().st_ino)
        journal.append(WORK[0])
        journal.close()
    assert len(files) == 1


def test_a_journal_of_before_owners_were_noted_is_gone_on_with(path, monkeypatch):
    monkeypatch.setattr(Journal, "_own", lambda self: self._write(self._beginning()))
    old = Journal(path, PLAN, {})
    old.append(WORK[0])
    old.close()
    monkeypatch.undo()
    again = Journal(path, PLAN, {})
    assert list(again.work()) == WORK[:1]
    again.close()


def test_a_failed_take_over_leaves_the_journal_as_it_was(path, locking, monkeypatch):
    first = Journal(path, PLAN, {})
    first.append(WORK[0])
    before = journal_of(path).read_bytes()
    monkeypatch.setattr(journals, "machine", lambda: "elsewhere")

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch, pytest.raises(UserError, match="cannot be taken over"):
        patch.setattr(os, "fsync", full)
        Journal(path, PLAN, {})
    assert journal_of(path).read_bytes() == before
    assert list(path.parent.iterdir()) == [journal_of(path)]
    first.append(WORK[1])
    assert list(first.work()) == WORK[:2]


def test_a_folder_that_is_away_for_a_while_stops_nobody(path):
    journal = Journal(path, PLAN, {})
    away = path.parent.with_name("away")
    path.parent.rename(away)
    journal.append(WORK[0])
    away.rename(path.parent)
    journal.append(WORK[1])
    assert list(journal.work()) == WORK[:2]
    journal.close(remove=True)
    assert list(path.parent.iterdir()) == []


def test_a_lock_of_this_machine_is_known_to_keep_others_out(tmp_path, monkeypatch):
    file = locks.take(tmp_path / "lock", "taken")
    assert locks.is_exclusive(file)
    monkeypatch.setattr(fcntl, "flock", lambda *_: (_ for _ in ()).throw(OSError(errno.ENOLCK, "")))
    assert not locks.is_exclusive(file)
    os.close(file)
