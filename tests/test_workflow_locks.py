"""A killed run does not stop the next one; a running one does."""

import os
import signal
import subprocess
import sys

import pytest

from tests.patience import wait_for
from tests.programs import checkout_environment
from tests.workflow_runs import CHECKOUT, snakemake
from workflow import locks

TAKE = "from workflow import locks; locks.take(); print('held', flush=True); input()"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Snakemake's folder with a lock in it, in the working directory."""
    (tmp_path / ".snakemake" / "locks").mkdir(parents=True)
    (tmp_path / ".snakemake" / "locks" / "0.output.lock").write_text("results/report.html\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path / ".snakemake"


@pytest.fixture
def holder(folder):
    """Another process that holds the lock of a run."""
    process = subprocess.Popen(
        [sys.executable, "-c", TAKE],
        cwd=folder.parent,
        env=checkout_environment(),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None and process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.communicate()


def left(folder):
    return [path.name for path in (folder / "locks").iterdir()]


def test_locks_of_a_killed_run_are_removed(folder, holder, capsys):
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    assert locks.take(folder)
    assert left(folder) == []
    assert f"process {holder.pid}" in capsys.readouterr().err


def test_locks_of_a_running_run_stay(folder, holder):
    assert not locks.take(folder)
    assert left(folder) == ["0.output.lock"]


def test_locks_of_somebody_else_stay_after_a_run_that_ended(folder, holder):
    holder.communicate("\n")
    locks.take(folder)
    assert left(folder) == ["0.output.lock"]


def test_locks_of_another_machine_stay(folder):
    (folder / "carillon.run").write_text('{"host": "elsewhere", "process": 1}')
    assert not locks.take(folder)
    assert left(folder) == ["0.output.lock"]


def test_a_signature_that_was_cut_off_is_of_nobody(folder):
    (folder / "carillon.run").write_text('{"host": "elsew')
    locks.take(folder)
    assert left(folder) == ["0.output.lock"]


@pytest.mark.nightly
def test_a_run_goes_on_after_the_one_before_was_killed(tmp_path):
    config = tmp_path / "config.yaml"
    config.write_text(
        "models: {bar: {mesh: 'builtin:bar', resolution: 8}}\n"
        "dataset: {samples: 40000000, distributions: [uniform], shards: 1}\n"
    )
    target, options = "results/dataset/uniform-0.h5", ["--cores", "1", "--configfile", config]
    command = [sys.executable, "-m", "snakemake", "-s", CHECKOUT / "Snakefile", target, *options]
    run = subprocess.Popen(
        [str(part) for part in command],
        cwd=tmp_path,
        env=checkout_environment(),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    journal = tmp_path / "results" / "dataset" / ".uniform-0.h5.journal"
    wait_for(journal.exists, "the journal", run)
    os.killpg(run.pid, signal.SIGKILL)
    run.wait()
    assert list((tmp_path / ".snakemake" / "locks").iterdir())
    done = snakemake(tmp_path, target, *options, "--until", "save_config")
    assert "removed the lock of a run that was killed" in done.stderr
    assert done.returncode == 0, done.stdout + done.stderr
