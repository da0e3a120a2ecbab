"""Tell where the time to a spectrum goes, and how near each phase is to what the machine can do."""

import argparse
import json

from carillon.parameters.command_line import add_options, collect
from carillon.records.measurement import measured
from solver.analysis.problem import ProblemOptions, build_problem
from solver.commands.running import add_solid, on_ranks, parameters, require_outputs, write_json
from studies.profile.measure import ProfileOptions, profile, profile_lines

EXAMPLES = """example:
  profile builtin:bell --resolution 32 --material smooth
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_solid(parser)
    add_options(parser, ProfileOptions)
    parser.add_argument("--out", help="also write the result to this JSON file")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    with on_ranks() as comm:
        require_outputs(arguments, comm)
        described = collect(ProblemOptions, arguments)
        model = build_problem(described).model
        result = profile(model, collect(ProfileOptions, arguments), described.seed)
        result["provenance"] = measured(parameters(arguments))
        write_json(arguments, result, comm)
    print(json.dumps(result, indent=2) if arguments.json else "\n".join(profile_lines(result)))
