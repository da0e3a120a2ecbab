"""Every command that the README names runs as it stands there, in the order of the page."""

from __future__ import annotations

import re
import sys

import pytest

from tests.readme_commands import CHECKOUT, README, SOUND, blocks, run, run_commands, section


@pytest.mark.slow
@pytest.mark.mpi
def test_commands_run_in_the_order_of_the_page(tmp_path):
    # Those about sound have a file of their own, which another process may run meanwhile.
    assert run_commands(README.replace(section(SOUND), ""), tmp_path) > 10
    assert (tmp_path / "coarse.h5").exists()


@pytest.mark.slow
def test_library_example_runs(tmp_path):
    (example,) = blocks("python")
    assert len(run([sys.executable, "-c", example], tmp_path).split()) >= 34


def test_make_targets_exist():
    named = set(re.findall(r"\bmake ([a-z]+)", README))
    targets = set(re.findall(r"^([a-z]+):", (CHECKOUT / "Makefile").read_text(), re.MULTILINE))
    assert {"run", "test", "env", "check"} <= named <= targets


def test_files_that_the_page_names_exist():
    for target in re.findall(r"\]\(([^)#:]+)\)", README):
        assert (CHECKOUT / target).exists(), target
    for path in re.findall(r"`((?:workflow|docs)/[^`*]+)`", README):
        assert (CHECKOUT / path).exists(), path
