"""The README and the pages of the documentation, and their commands, run as they stand there."""

import os
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from carillon.fem.geometry import builtin_surface
from conftest import MESH_FILES
from tests.patience import HANG_SECONDS
from tests.programs import CHECKOUT

DOCS = CHECKOUT / "docs"
PAGES = [CHECKOUT / "README.md", *sorted(DOCS.rglob("*.md"))]

SOUND = DOCS / "tutorials" / "sound.md"

RUN = ("sh", "python", "yaml")
"""Languages of blocks that are run, or written to a file first."""
PROSE = ("", "text", "markdown", "{toctree}", "{include}", "{eval-rst}")
"""Those of blocks that are read."""

PROGRAMS = {
    ".venv/bin/python": [sys.executable],
    ".venv/bin/carillon": [sys.executable, str(Path(sys.executable).with_name("carillon"))],
}
"""Programs of the environment, and how the tests call them: as people do."""
_PROGRAM = re.compile(rf"(?<!\S)({'|'.join(map(re.escape, PROGRAMS))})(?!\S)")

_BLOCK = re.compile(
    r"(?P<spared><!-- not run: [^\n]+ -->\n)?^(?P<fence>`{3,})(?P<language>\S*)[^\n]*\n"
    r"(?P<text>.*?)^(?P=fence)$",
    re.MULTILINE | re.DOTALL,
)
_AFTER = re.compile(r"^<!-- after: (\S+) -->$", re.MULTILINE)
_FILE = re.compile(r"# (\S+\.yaml)\n")
_COMMAND = re.compile(r"^for .*?^done$|^[^\n]*\S[^\n]*$", re.MULTILINE | re.DOTALL)
"""A line, or all lines of a loop."""


class Block(NamedTuple):
    """A block of code of a page; `spared` ones are marked as not to be run."""

    language: str
    text: str
    spared: bool


def blocks(page: Path) -> list[Block]:
    """The blocks of a page, in order."""
    return [
        Block(found["language"], found["text"], found["spared"] is not None)
        for found in _BLOCK.finditer(page.read_text())
    ]


def prose(page: Path) -> str:
    """A page without its blocks."""
    return _BLOCK.sub("", page.read_text())


def commands(block: Block) -> list[str]:
    """Commands of a block: lines, continued ones as one, and loops."""
    return _COMMAND.findall(re.sub(r" \\\n\s*", " ", block.text))


def has_commands(page: Path) -> bool:
    """Whether anything on a page is to be run."""
    return any(block.language in ("sh", "python") and not block.spared for block in blocks(page))


def page_before(page: Path) -> Path | None:
    """The page in whose folder this one goes on, if it says so."""
    found = _AFTER.search(page.read_text())
    return (page.parent / found[1]).resolve() if found else None


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


@dataclass
class Reader:
    """Somebody who reads pages and types what stands there, all of it in one folder.

    What was typed already is not typed again, be it a page that another goes on from, or a command
    that stands on several.
    """

    folder: Path
    read: set[Path] = field(default_factory=set)
    printed: dict[str, str] = field(default_factory=dict)

    def follow(self, page: Path) -> list[str]:
        """Run the blocks of a page in order; what its commands printed."""
        before = page_before(page)
        if before is not None and before not in self.read:
            self.follow(before)
        self.read.add(page)
        for block in blocks(page):
            named = _FILE.match(block.text) if block.language == "yaml" else None
            if named:
                (self.folder / named[1]).write_text(block.text)
        printed = []
        for block in blocks(page):
            if not block.spared and block.language == "python":
                printed.append(self._once(block.text, [sys.executable, "-c", block.text]))
            if not block.spared and block.language == "sh":
                printed += [self._type(line) for line in commands(block)]
        return printed

    def _type(self, line: str) -> str:
        words = shlex.split(line, comments=True)
        if words[0] != ".venv/bin/snakemake":
            typed = _PROGRAM.sub(lambda found: shlex.join(PROGRAMS[found[0]]), line)
            return self._once(line, ["bash", "-e", "-c", typed])
        # The rules themselves run in the tests of the workflow.
        # The last --config counts, so that what the line says goes into it too.
        said = words[words.index("--config") + 1 :] if "--config" in words else []
        command = [sys.executable, "-m", "snakemake", *words[1:], "--dry-run"]
        meshes = f"mesh_folder={stand_ins(self.folder)}"
        return self._once(line, [*command, "--config", meshes, *said], CHECKOUT)

    def _once(self, text: str, command: list[str], folder: Path | None = None) -> str:
        if text not in self.printed:
            self.printed[text] = run(command, folder or self.folder)
        return self.printed[text]
