"""Programs that are started end with whoever started them, also if that is killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from carillon.processes.children import run_child

CHECKOUT = Path(__file__).resolve().parent.parent

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
