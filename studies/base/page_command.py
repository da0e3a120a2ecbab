"""Make the page of a study by its rules; all options but --cores go to Snakemake.

It is short for `snakemake -s $(carillon rules) --cores all NAME ...`, run in the present folder.
Results are made there, too, which may take hours: `-n` shows what would run.
"""

import argparse
import subprocess
import sys

from workflow import settings

EXAMPLES = """examples:
  study claims -n
  study figures --configfile paper.yaml --cores 8
"""
FURTHER = "options of Snakemake"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("--cores", default="all", help="cores to use (default: all)")


def run(arguments: argparse.Namespace) -> int:
    """Run the rules; returns the exit status of Snakemake."""
    command = [sys.executable, "-m", "snakemake", "-s", str(settings.FOLDER / "Snakefile")]
    command += ["--cores", arguments.cores, arguments.command, *arguments.further]
    return subprocess.run(command).returncode
