"""Every command that the README names runs as it stands there, in the order of the page."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from solver.geometry import builtin_surface
from tests.conftest import MESH_FILES

CHECKOUT = Path(__file__).resolve().parent.parent
README = (CHECKOUT / "README.md").read_text()
TIMEOUT = 300


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, flags=re.MULTILINE | re.DOTALL)


def environment() -> dict[str, str]:
    return {
        **os.environ,
        "PYTHONPATH": str(CHECKOUT),
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMPI_MCA_rmaps_base_oversubscribe": "1",
    }


def run(command: list[str], folder: Path) -> str:
    done = subprocess.run(
        command, cwd=folder, env=environment(), capture_output=True, text=True, timeout=TIMEOUT
    )
    assert done.returncode == 0, f"{shlex.join(command)}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def stand_ins(folder: Path) -> Path:
    """Folder with meshes under the names that the example of user meshes expects."""
    for name in MESH_FILES:
        builtin_surface("bell").export(folder / name)
    return folder


@pytest.mark.slow
@pytest.mark.mpi
def test_commands_run_in_the_order_of_the_page(tmp_path):
    commands = [line for block in blocks("sh") for line in block.splitlines() if line.strip()]
    assert len(commands) > 10
    for line in commands:
        words = shlex.split(line, comments=True)
        if words[0] == ".venv/bin/snakemake":
            # The rules themselves run in the tests of the workflow.
            # The last --config counts, so that what the line says goes into it too.
            said = words[words.index("--config") + 1 :] if "--config" in words else []
            command = [sys.executable, "-m", "snakemake", *words[1:], "--dry-run"]
            run([*command, "--config", f"mesh_folder={stand_ins(tmp_path)}", *said], CHECKOUT)
            continue
        words = [sys.executable if word == ".venv/bin/python" else word for word in words]
        run(words, tmp_path)
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
