"""Tell where the time to a spectrum goes, and how near each phase is to what the machine can do."""

import argparse

from carillon.parameters.command_line import add_options
from solver.commands.running import COMPOSED, add_outputs, add_solid, measure_solid
from studies.profile.measure import ProfileOptions, profile, profile_lines

EXAMPLES = """example:
  profile builtin:bell --resolution 32 --material smooth
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_solid(parser, *COMPOSED)
    add_options(parser, ProfileOptions)
    add_outputs(parser)


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    measure_solid(arguments, ProfileOptions, profile, profile_lines)
