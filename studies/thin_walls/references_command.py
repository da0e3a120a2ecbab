"""Make the references of the study of thin walls again.

Solids of revolution take seconds to a minute, those of tetrahedra some minutes and 4 GB. Entries of
other solids stay as they are.
"""

import argparse
from pathlib import Path

from carillon.command_line.outputs import require_outputs
from carillon.command_line.progress import say, track
from studies.thin_walls.catalogue import REFERENCES
from studies.thin_walls.names import add_solids, chosen_solids
from studies.thin_walls.references import compute_reference, read_references, write_references

EXAMPLES = """example:
  thin-wall-references --solids ring,cymbal --out references.yaml
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_solids(parser)
    parser.add_argument(
        "--out",
        default=str(REFERENCES),
        metavar="FILE",
        help="file of references (YAML) that they are written to (default: that of the study)",
    )


def run(arguments: argparse.Namespace) -> None:
    """Compute and write, solid by solid."""
    require_outputs(arguments)
    out = Path(arguments.out)
    for name, solid in track(list(chosen_solids(arguments).items()), "solids"):
        found = compute_reference(name, solid)
        write_references(read_references(out) | {name: found}, out)
        say(f"{name}: {found.method}, {found.how}, to {found.doubt:.1e}")
