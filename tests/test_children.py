"""Programs that are started end with whoever started them, also if that is killed."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing

import pytest

from carillon.processes.children import ProcessPool, run_child
from tests.programs import CHECKOUT

HOLDING = """
import signal, sys
pipe = open(sys.argv[1], "w")
print("ready", file=pipe, flush=True)
signal.pause()
"""
PARENT = """
import os, signal, sys
from carillon.processes.children import run_child
signal.signal(signal.SIGINT, signal.default_int_handler)  # which a job in the background ignores
run_child([sys.executable, "-c", sys.argv[1], sys.argv[2]], os.environ)
"""


def test_output_and_status_are_handed_on():
    done = run_child([sys.executable, "-c", "print(1); import sys; sys.exit('no')"], os.environ)
    assert (done.returncode, done.stdout, done.stderr) == (1, "1\n", "no\n")


def test_a_child_that_takes_too_long_is_ended(tmp_path):
    program = "import os, sys, time; open(sys.argv[1], 'w').write(str(os.getpid())); time.sleep(60)"
    with pytest.raises(subprocess.TimeoutExpired):
        run_child([sys.executable, "-c", program, str(tmp_path / "id")], os.environ, seconds=2.0)
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "id").read_text()), 0)


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_a_child_ends_when_its_parent_is_killed(how, tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT, HOLDING, str(pipe)], cwd=CHECKOUT, stderr=subprocess.DEVNULL
    )
    with open(pipe) as stream:
        assert stream.readline() == "ready\n"
        parent.send_signal(how)
        parent.wait()
        assert stream.read() == ""  # comes to an end, since the child does, who has it open


# Processes ---------------------------------------------------------------------------------------


def late_for_even(task):
    time.sleep(0.02 * (task % 2 == 0))
    return task


def begun_and_yielded(pool, window):
    """The largest number of tasks that were begun and not yielded, and all results."""
    begun, results, largest = [], [], 0

    def tasks():
        for task in range(30):
            begun.append(task)
            yield task

    for result in pool.in_order(late_for_even, tasks(), window):
        largest = max(largest, len(begun) - len(results))
        results.append(result)
    return largest, results


def test_results_come_in_order_and_no_more_than_a_window_is_begun():
    with closing(ProcessPool(2)) as pool:
        assert begun_and_yielded(pool, 8) == (8, list(range(30)))


def signals_and_ranks(_):
    held = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    return {signal.SIGINT, signal.SIGTERM} <= held, os.environ.get("OMPI_COMM_WORLD_RANK")


def test_processes_hear_no_signal_to_stop_and_are_no_ranks(monkeypatch):
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "1")
    with closing(ProcessPool(1)) as pool:
        assert pool.submit(signals_and_ranks, None).result() == (True, None)
    assert os.environ["OMPI_COMM_WORLD_RANK"] == "1"
    assert not signal.pthread_sigmask(signal.SIG_BLOCK, ()) & {signal.SIGINT, signal.SIGTERM}


def test_a_program_started_where_signals_are_held_still_ends_with_its_parent():
    sleeping = [sys.executable, "-c", "import signal; print(signal.pthread_sigmask(0, ()))"]
    former = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGTERM,))
    try:
        assert "SIGTERM" not in run_child(sleeping, os.environ).stdout
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, former)


@pytest.mark.parametrize("code", [7, -9])
def test_a_process_that_dies_is_told_by_its_code(code):
    with closing(ProcessPool(2)) as pool:
        with pytest.raises(BrokenProcessPool):
            pool.submit(die, code).result()
        assert pool.failure() == code


def die(code):
    if code < 0:
        os.kill(os.getpid(), -code)
    os._exit(code)
