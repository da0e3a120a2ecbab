"""A shard under way: killed, resumed, locked, out of disk, and what is there already."""

import errno
import fcntl
import json
import os
import resource
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from carillon.errors import UserError
from dataset_gen import generate as generate_module
from dataset_gen import settings as settings_module
from dataset_gen.generate import engine_of, generate, generate_file
from dataset_gen.journal import Journal, journal_of
from dataset_gen.objectives import DEFAULT_OBJECTIVE, SAMPLED, fit, fit_samples
from dataset_gen.settings import ShardOptions, settings_of
from dataset_gen.shards import origin_of
from dataset_gen.tasks import ROW, ShardPlan, in_this_process
from tests.patience import HANG_SECONDS, wait_for
from tests.programs import checkout_environment
from tests.shard_files import read_shard

SAMPLES, TASK = 3000, 128


def plan_of(samples=SAMPLES, task_rows=TASK, **settings):
    return ShardPlan(settings_of(ShardOptions(samples, 4, **settings)), task_rows)


def make(path, plan=None, engine=in_this_process):
    plan = plan or plan_of()
    return generate_file(path, plan, origin_of(plan.settings, ShardOptions(SAMPLES)), engine)


def stopping_after(tasks):
    """An engine that is interrupted after so many tasks."""

    def engine(plan, numbers):
        for number in numbers[:tasks]:
            yield plan.work(number)
        raise KeyboardInterrupt

    return engine


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """The bytes of the shard, made in one go."""
    path = tmp_path_factory.mktemp("reference") / "shard.h5"
    assert make(path) == SAMPLES
    return path.read_bytes()


@pytest.fixture
def path(tmp_path):
    return tmp_path / "shard.h5"


@pytest.fixture
def begun(path):
    """A shard of which five tasks are in the journal."""
    with pytest.raises(KeyboardInterrupt):
        make(path, engine=stopping_after(5))
    assert journal_of(path).exists() and not path.exists()
    return path


# Bytes -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("workers", [1, 2])
def test_bytes_do_not_depend_on_workers(path, reference, workers):
    assert make(path, engine=engine_of(workers)) == SAMPLES
    assert path.read_bytes() == reference
    assert list(path.parent.iterdir()) == [path]


def test_sampled_forces_do_not_depend_on_workers_nor_on_shards(path):
    plan = plan_of(20, 8, objective=SAMPLED)
    assert make(path, plan) == 20
    again = path.with_name("again.h5")
    assert make(again, plan, engine_of(2)) == 20
    assert again.read_bytes() == path.read_bytes()
    parts = [
        generate(ShardOptions(20, 4, shard, 3, SAMPLED), progress=False).coarse
        for shard in range(3)
    ]
    np.testing.assert_array_equal(np.concatenate(parts), read_shard(path).coarse)


def test_sampled_forces_are_each_samples_own_and_come_near_the_closed_form():
    block = np.tile(np.linspace(1.0, 8.0, 8), (4, 1))
    found = fit_samples(SAMPLED, block, 0, 10, 0.25)
    assert found.converged.all() and len(np.unique(found.moduli[:, 0])) == 4
    shifted = fit_samples(SAMPLED, block, 0, 11, 0.25)
    np.testing.assert_array_equal(shifted.moduli[:-1], found.moduli[1:])
    # Single moduli scatter by tens of percent, what they are together does not.
    exact = fit("energy", block).moduli.mean(axis=1)
    np.testing.assert_allclose(found.moduli.mean(axis=1), exact, rtol=0.1)


def test_an_interrupted_shard_goes_on_and_has_the_same_bytes(begun, reference, caplog):
    caplog.set_level("INFO")
    assert make(begun, engine=engine_of(2)) == SAMPLES - 5 * TASK
    assert begun.read_bytes() == reference
    assert f"going on after {5 * TASK} of 3,000 samples" in caplog.text
    assert list(begun.parent.iterdir()) == [begun]


def test_a_shard_finished_elsewhere_says_so(begun, reference, monkeypatch):
    def elsewhere(*arguments):
        return origin_of(*arguments) | {"processor": "another"}

    plan = plan_of()
    generate_file(begun, plan, elsewhere(plan.settings, ShardOptions(SAMPLES)))
    origin = read_shard(begun).provenance
    assert origin["processor"] != "another"
    assert [record["processor"] for record in json.loads(origin["resumed_on"])] == ["another"]


PROGRAM = f"""
import sys, time
from carillon.command_line import exit_status
from carillon.files import hdf5
from dataset_gen import journal
from dataset_gen.generate import engine_of, generate, generate_file
from dataset_gen.settings import ShardOptions, settings_of
from dataset_gen.shards import origin_of
from dataset_gen.tasks import ShardPlan

path, workers, seconds = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])

def slow(plan, numbers):
    for work in engine_of(workers)(plan, numbers):
        time.sleep(seconds)
        yield work

def slowly(self, read=journal.Journal.work):
    for work in read(self):
        time.sleep(seconds / 10)
        yield work

def sealed_slowly(stream, seal=hdf5._seal_of):
    time.sleep(10 * seconds)
    return seal(stream)

def main():
    journal.Journal.work, hdf5._seal_of = slowly, sealed_slowly
    plan = ShardPlan(settings_of(ShardOptions({SAMPLES}, 4)), {TASK})
    print("begin", flush=True)
    generate_file(path, plan, origin_of(plan.settings, ShardOptions({SAMPLES})), slow)

if __name__ == "__main__":
    sys.exit(exit_status.run("program", main))
"""
"""Makes the shard of the tests, with time to interrupt it."""


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    path = tmp_path_factory.mktemp("program") / "program.py"
    path.write_text(PROGRAM)
    return path


@pytest.fixture
def start(path, program):
    """Start the program; it is killed at the end of the test if it is running still."""
    running = []

    def start(workers=1, seconds=0.05, **options):
        command = [sys.executable, program, path, workers, seconds]
        environment = checkout_environment()
        process = subprocess.Popen(
            [str(part) for part in command],
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            **options,
        )
        running.append(process)
        assert process.stdout.readline() == "begin\n"
        return process

    yield start
    for process in running:
        process.kill()
        process.communicate()


@pytest.mark.nightly
def test_killed_at_ten_random_moments_it_ends_with_the_same_bytes(path, start, reference):
    """Early ones fall into the fits, later ones, with the journal full, into sealing the shard."""
    generator = np.random.default_rng()
    rows = []
    for delay in generator.uniform(0.0, 0.7, 10):
        process = start()
        time.sleep(delay)
        process.kill()
        process.wait()
        rows.append(size_of(journal_of(path)))
        if path.exists():
            break
    assert rows == sorted(rows) or path.exists(), f"the journal shrank: {rows}"
    assert start(seconds=0).wait(HANG_SECONDS) == 0
    assert path.read_bytes() == reference
    assert list(path.parent.iterdir()) == [path]


def children(pid):
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def is_running(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_workers_do_not_outlive_a_killed_parent(path, start):
    process = start(workers=2)
    wait_for(lambda: size_of(journal_of(path)) > 10_000, "the journal", process)
    workers = children(process.pid)
    assert len(workers) >= 2
    process.kill()
    process.wait()
    wait_for(lambda: not any(is_running(worker) for worker in workers), "the end of its workers")
    assert not path.exists()


def size_of(path):
    return path.stat().st_size if path.exists() else 0


def test_a_worker_that_dies_is_told_in_a_sentence(path, monkeypatch):
    killed = []

    def engine(plan, tasks):
        results = engine_of(2)(plan, tasks)
        yield next(results)
        for child in children(os.getpid()):
            if "spawn_main" in Path(f"/proc/{child}/cmdline").read_text() and not killed:
                os.kill(child, signal.SIGKILL)
                killed.append(child)
        yield from results

    with pytest.raises(UserError, match="a worker died with exit code -9"):
        make(path, plan_of(2000, 20), engine)
    assert journal_of(path).exists()


# The journal -------------------------------------------------------------------------------------


@pytest.mark.parametrize("cut", [1, 7, 100, 5000])
def test_a_torn_journal_goes_on_after_the_last_whole_task(begun, reference, cut, caplog):
    caplog.set_level("INFO")
    journal = journal_of(begun)
    with open(journal, "rb+") as stream:
        stream.truncate(journal.stat().st_size - cut)
    make(begun)
    assert f"going on after {4 * TASK}" in caplog.text
    assert begun.read_bytes() == reference


@pytest.mark.parametrize("place", np.linspace(0.05, 0.95, 7))
def test_a_damaged_journal_goes_on_before_the_damage(begun, reference, place, caplog):
    journal = journal_of(begun)
    content = bytearray(journal.read_bytes())
    content[int(place * len(content))] ^= 4
    journal.write_bytes(content)
    make(begun)
    assert "done again" in caplog.text
    assert begun.read_bytes() == reference


@pytest.mark.parametrize("size", [0, 5, 40, 100])
def test_a_journal_cut_off_within_its_beginning_is_begun_again(begun, reference, size):
    journal = journal_of(begun)
    journal.write_bytes(journal.read_bytes()[:size])
    make(begun)
    assert begun.read_bytes() == reference


@pytest.mark.parametrize("content", [b"x" * 1000, None])
def test_what_is_no_journal_is_left_alone(begun, content):
    journal = journal_of(begun)
    if content is None:
        damaged = bytearray(journal.read_bytes())
        damaged[60] ^= 1
        content = bytes(damaged)
    journal.write_bytes(content)
    with pytest.raises(UserError, match="remove it to begin again"):
        make(begun)
    assert journal.read_bytes() == content


@pytest.mark.parametrize(
    ("plan", "message"),
    [
        (plan_of(objective="hybrid"), f"objective {DEFAULT_OBJECTIVE} where hybrid is asked for"),
        (plan_of(SAMPLES + 1), "samples up to 3000 where 3001"),
        (plan_of(high=9), "moduli up to 10.0 where 9.0"),
        (plan_of(distribution="log-uniform"), "distribution uniform where log-uniform"),
        (plan_of(task_rows=64), "tasks of 128 samples"),
    ],
)
def test_a_journal_of_other_settings_is_refused_and_kept(begun, plan, message):
    before = journal_of(begun).read_bytes()
    with pytest.raises(UserError, match=message):
        make(begun, plan)
    assert journal_of(begun).read_bytes() == before


def test_a_journal_of_another_poissons_ratio_is_refused(tmp_path):
    path = tmp_path / "shard.h5"
    plan, other = (plan_of(objective="hybrid", poisson=poisson) for poisson in (0.25, 0.3))
    with pytest.raises(KeyboardInterrupt):
        make(path, plan, stopping_after(1))
    with pytest.raises(UserError, match="Poisson's ratio 0.25 where 0.3"):
        make(path, other)


def test_fits_of_other_code_are_not_mixed(begun, monkeypatch):
    monkeypatch.setattr(settings_module, "code_of_rows", lambda: "other")
    with pytest.raises(UserError, match="samples or fits by the code [0-9a-f]{12} where other is"):
        make(begun)


def test_one_shard_is_generated_once_at_a_time(path, start):
    process = start()
    wait_for(journal_of(path).exists, "the journal", process)
    holder = f"process {process.pid} on {socket.gethostname()} is generating this shard"
    # The journal is there before it says whose it is.
    with pytest.raises(UserError, match=f"({holder}|another process is generating this shard)"):
        make(path)
    assert process.poll() is None and journal_of(path).exists()


def test_a_file_system_without_locks_is_told(path, monkeypatch, caplog):
    def unsupported(*_):
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(fcntl, "flock", unsupported)
    make(path, plan_of(200))
    assert "has no locks" in caplog.text


# What is there already ---------------------------------------------------------------------------


def test_the_same_shard_is_not_made_twice(path, monkeypatch):
    plan = plan_of(200)
    make(path, plan)
    before = path.stat().st_mtime_ns
    # As after a kill between the renaming of the shard and the removal of its journal.
    journal_of(path).write_bytes(b"")
    monkeypatch.setattr(generate_module, "_results", None)
    assert make(path, plan) is None
    assert path.stat().st_mtime_ns == before
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize(
    ("plan", "message"),
    [
        (
            plan_of(200, objective="hybrid"),
            f"objective {DEFAULT_OBJECTIVE} where hybrid is asked for",
        ),
        (plan_of(201), "samples up to 200 where 201"),
        (plan_of(200, low=1), "moduli from 0.0 where 1.0"),
        (ShardPlan(settings_of(ShardOptions(200, 5))), "seed 4 where 5"),
        (ShardPlan(settings_of(ShardOptions(400, 4, 1, 2))), "first sample 0 where 200"),
    ],
)
def test_another_shard_is_not_overwritten(path, plan, message):
    make(path, plan_of(200))
    before = path.read_bytes()
    with pytest.raises(UserError, match=message):
        make(path, plan)
    assert path.read_bytes() == before and list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("content", [b"", b"notes", None])
def test_what_is_no_shard_is_not_overwritten(path, content):
    if content is None:
        make(path, plan_of(200))
        content = path.read_bytes()[:-1]
    path.write_bytes(content)
    with pytest.raises(UserError) as error:
        make(path, plan_of(200))
    assert "exists and is not the shard asked for" in str(error.value)
    assert "\n" not in str(error.value)
    assert path.read_bytes() == content and list(path.parent.iterdir()) == [path]


# A full disk -------------------------------------------------------------------------------------

JOURNAL_BYTES = SAMPLES * ROW.itemsize + 2000
"""The journal and the beginning of the shard, which is larger still."""


@pytest.mark.parametrize(
    ("largest_file", "kept"), [(10, 0), (1000, 0), (100_000, 5 * TASK), (JOURNAL_BYTES, SAMPLES)]
)
def test_a_full_disk_is_told_in_a_sentence_and_nothing_finished_is_lost(
    path, start, reference, largest_file, kept
):
    assert len(reference) > JOURNAL_BYTES
    limit = (resource.RLIMIT_FSIZE, (largest_file, largest_file))
    process = start(seconds=0, preexec_fn=lambda: resource.setrlimit(*limit))
    (line,) = process.communicate(timeout=HANG_SECONDS)[1].splitlines()
    assert process.returncode == 2
    assert line.startswith("program: ") and "make room and run the same command again" in line
    if 0 < kept < SAMPLES:
        assert f"{kept:,} of {SAMPLES:,} samples are kept" in line
    assert set(path.parent.iterdir()) <= {journal_of(path)}
    assert make(path) == SAMPLES - kept
    assert path.read_bytes() == reference
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("number", ["ENOSPC", "EDQUOT", "EFBIG", "EIO"])
def test_no_failed_write_leaves_half_a_task(path, monkeypatch, number):
    code = getattr(errno, number)
    write = os.pwrite
    journal = Journal(path, plan_of(), {})
    journal.append(bytes(TASK * ROW.itemsize))

    def failing(file, data, position):
        write(file, data[:100], position)
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(os, "pwrite", failing)
    with pytest.raises(UserError, match="128 of 3,000 samples are kept") as error:
        journal.append(bytes(TASK * ROW.itemsize))
    assert ("make room" in str(error.value)) == (number != "EIO")
    monkeypatch.undo()
    journal.close()
    again = Journal(path, plan_of(), {})
    assert again.tasks == 1
    assert [len(work) for work in again.work()] == [TASK * ROW.itemsize]
    again.close(remove=True)
