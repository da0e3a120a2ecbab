"""Find the elastic constants that the frequencies of a measured solid ask for."""

import argparse

from studies.measured.fit import as_text, fitted
from studies.measured.solid import read_solid

EXAMPLES = """example:
  fit-constants titanium-block
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("solid", help="name of a solid of the study, or a data file of another")


def run(arguments: argparse.Namespace) -> None:
    """Fit and print."""
    print(as_text(fitted(read_solid(arguments.solid))))
