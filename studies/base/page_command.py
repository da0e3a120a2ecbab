"""Make the page of a study by its rules; what stands behind the name goes to Snakemake.

It is short for `snakemake -s $(carillon rules) --cores all NAME ...`, run in the present folder.
"""

import argparse
import subprocess
import sys

from workflow import settings

EXAMPLES = """examples:
  study claims
  study figures --configfile paper.yaml --cores 8
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("--cores", default="all", help="cores to use (default: all)")
    parser.add_argument("snakemake", nargs=argparse.REMAINDER, help="further options of Snakemake")


def run(arguments: argparse.Namespace) -> int:
    """Run the rules; returns the exit status of Snakemake."""
    command = [sys.executable, "-m", "snakemake", "-s", str(settings.FOLDER / "Snakefile")]
    command += ["--cores", arguments.cores, arguments.command, *arguments.snakemake]
    return subprocess.run(command).returncode
