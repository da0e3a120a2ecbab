"""Tell where the time to a spectrum goes, and how near each phase is to what the machine can do."""

import argparse

from carillon.parameters.command_line import add_options, collect
from solver.analysis.problem import ProblemOptions, build_problem
from solver.commands.running import add_outputs, add_solid, on_ranks, require_outputs, tell_measured
from studies.profile.measure import ProfileOptions, profile, profile_lines

EXAMPLES = """example:
  profile builtin:bell --resolution 32 --material smooth
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_solid(parser)
    add_options(parser, ProfileOptions)
    add_outputs(parser)


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    with on_ranks() as comm:
        require_outputs(arguments, comm)
        described = collect(ProblemOptions, arguments)
        model = build_problem(described).model
        result = profile(model, collect(ProfileOptions, arguments), described.seed)
        tell_measured(arguments, result, lambda found: "\n".join(profile_lines(found)), comm)
