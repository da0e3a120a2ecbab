"""Print the path of Snakemake's rules, which an installed Carillon has in a folder of its own."""

import argparse

from workflow import settings

EXAMPLES = """example:
  snakemake -s "$(carillon rules)" --configfile workflow.yaml --cores 2
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """There are no arguments."""


def run(arguments: argparse.Namespace) -> None:
    """Print the path."""
    print(settings.FOLDER / "Snakefile")
