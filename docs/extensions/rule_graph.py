"""The picture of the rules in the documentation: `python docs/extensions/rule_graph.py`.

Snakemake says which rule of the default run needs which; Graphviz, which nothing else needs, leaves
out what follows from other arrows and lays out the rest.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from workflow import settings

PICTURE = Path(__file__).resolve().parent.parent / "rules.svg"
TARGET = "all"
"""The rule that computes nothing, which is left out."""
STYLE = """\
graph [rankdir=LR, size="10.4,10", bgcolor=white, pad=0.1, ranksep=0.3, nodesep=0.15]
node [shape=box, style="rounded,filled", fillcolor="#eef3f8", color="#4a6f96",
      fontname="sans-serif", fontsize=12, height=0.3, margin="0.12,0.05"]
edge [color="#8a94a0", arrowsize=0.6]"""


def output_of(command: list[str], text: str = "", folder: str | None = None) -> str:
    """What a program prints about a text."""
    environment = {**os.environ, "PYTHONPATH": str(settings.FOLDER.parent)}
    return subprocess.run(
        command,
        input=text,
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    ).stdout


def main() -> None:
    """Draw the picture anew."""
    if shutil.which("tred") is None:
        sys.exit("no tred on PATH to draw the rules with; install Graphviz")
    snakemake = [sys.executable, "-m", "snakemake", "-s", str(settings.FOLDER / "Snakefile")]
    with tempfile.TemporaryDirectory() as folder:
        graph = output_of([*snakemake, "--rulegraph", "--cores", "1"], folder=folder)
    names = dict(re.findall(r'(\d+)\[label = "(\w+)"', graph))
    pairs = [(names[first], names[then]) for first, then in re.findall(r"(\d+) -> (\d+)", graph)]
    arrows = [f"{first} -> {then}" for first, then in sorted(pairs) if then != TARGET]
    rules = "\n".join(["digraph rules {", STYLE, *arrows, "}", ""])
    PICTURE.write_text(output_of(["dot", "-Tsvg"], output_of(["tred"], rules)))


if __name__ == "__main__":
    main()
