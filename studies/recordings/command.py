"""Bring real recordings of strikes, on which the extraction of modes is measured.

They are those of two packages of Debian and Ubuntu, 160 MB to be loaded, which are unpacked and not
installed. What is there already stays.
"""

import argparse
from pathlib import Path

from carillon.parameters import REQUIRED, option, parameters
from carillon.parameters.command_line import add_options, collect
from studies.recordings.packages import bring
from workflow.disk_space import make_folder

EXAMPLES = """example:
  recordings --out results/recordings/packages
"""


@parameters
class RecordingsOptions:
    """Where recordings are put."""

    out: str = option(REQUIRED, "folder that gets a folder for each package", metavar="FOLDER")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser, RecordingsOptions)


def run(arguments: argparse.Namespace) -> None:
    """Bring what is missing, and print where it lies.

    Raises UserError if a package cannot be had or unpacked.
    """
    folder = Path(collect(RecordingsOptions, arguments).out)
    make_folder(folder)
    print("\n".join(map(str, bring(folder))))
