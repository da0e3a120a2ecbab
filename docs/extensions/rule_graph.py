"""The picture of the rules in the documentation: `python docs/extensions/rule_graph.py`.

Snakemake says which rule of the default run needs which; Graphviz, which nothing else needs, leaves
out what follows from other arrows and lays out the rest.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from carillon.command_line import exit_status
from carillon.errors import UserError
from workflow import settings

PROGRAM = "rule_graph"
PICTURE = Path(__file__).resolve().parent.parent / "rules.svg"
TARGET = "all"
"""The rule that computes nothing, which is left out."""
STYLE = """\
graph [rankdir=LR, size="10.4,10", bgcolor=white, pad=0.1, ranksep=0.3, nodesep=0.15]
node [shape=box, style="rounded,filled", fillcolor="#eef3f8", color="#4a6f96",
      fontname="sans-serif", fontsize=12, height=0.3, margin="0.12,0.05"]
edge [color="#8a94a0", arrowsize=0.6]"""


def needs() -> list[tuple[str, str]]:
    """Pairs of a rule of the default run and one that needs its files."""
    command = [
        sys.executable,
        "-m",
        "snakemake",
        "-s",
        str(settings.FOLDER / "Snakefile"),
        "--rulegraph",
    ]
    with tempfile.TemporaryDirectory() as folder:
        return pairs(_output_of([*command, "--cores", "1"], folder))


def pairs(graph: str) -> list[tuple[str, str]]:
    """The arrows of a graph of Snakemake's, by the names of the rules."""
    names = dict(re.findall(r'(\d+)\[label = "(\w+)"', graph))
    arrows = re.findall(r"(\d+) -> (\d+)", graph)
    return sorted((names[first], names[then]) for first, then in arrows if names[then] != TARGET)


def draw(arrows: list[tuple[str, str]]) -> str:
    """The rules as SVG, from the first to the last.

    Raises UserError if Graphviz is not installed.
    """
    lines = [STYLE, *(f"{first} -> {then}" for first, then in arrows)]
    graph = "digraph rules {\n" + "\n".join(lines) + "\n}\n"
    return _output_of(["dot", "-Tsvg"], text=_output_of(["tred"], text=graph))


def _output_of(command: list[str], folder: str | None = None, text: str | None = None) -> str:
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(settings.FOLDER.parent)},
            input=text,
            capture_output=True,
            text=True,
        )
    except FileNotFoundError:
        raise UserError(
            f"no {command[0]} on PATH to draw the rules with; install Graphviz"
        ) from None
    if done.returncode:
        raise UserError(f"{command[0]} failed: {done.stderr.strip()}")
    return done.stdout


def main() -> int:
    """Draw the picture anew."""
    PICTURE.write_text(draw(needs()))
    return 0


if __name__ == "__main__":
    sys.exit(exit_status.run(PROGRAM, main))
