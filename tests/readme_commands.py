"""The README's commands, run as they stand there."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

from carillon.fem.geometry import builtin_surface
from tests.conftest import MESH_FILES
from tests.patience import HANG_SECONDS

CHECKOUT = Path(__file__).resolve().parent.parent
README = (CHECKOUT / "README.md").read_text()


SOUND = "Design a sound"


def section(title: str) -> str:
    """Text below a heading."""
    return re.split(rf"^## {title}\n", README, flags=re.MULTILINE)[1].split("\n## ")[0]


def blocks(language: str, text: str = README) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


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
        command, cwd=folder, env=environment(), capture_output=True, text=True, timeout=HANG_SECONDS
    )
    assert done.returncode == 0, f"{shlex.join(command)}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def stand_ins(folder: Path) -> Path:
    """Folder with meshes under the names that the example of user meshes expects."""
    for name in MESH_FILES:
        builtin_surface("bell").export(folder / name)
    return folder


def run_commands(text: str, folder: Path) -> int:
    """Run the `sh` blocks of a text in order, its files written first; how many commands."""
    for block in blocks("yaml", text):
        if named := re.match(r"# (\S+\.yaml)\n", block):
            (folder / named[1]).write_text(block)
    commands = [line for block in blocks("sh", text) for line in block.splitlines() if line.strip()]
    for line in commands:
        words = shlex.split(line, comments=True)
        if words[0] == ".venv/bin/snakemake":
            # The rules themselves run in the tests of the workflow.
            # The last --config counts, so that what the line says goes into it too.
            said = words[words.index("--config") + 1 :] if "--config" in words else []
            command = [sys.executable, "-m", "snakemake", *words[1:], "--dry-run"]
            run([*command, "--config", f"mesh_folder={stand_ins(folder)}", *said], CHECKOUT)
            continue
        run([sys.executable if word == ".venv/bin/python" else word for word in words], folder)
    return len(commands)
