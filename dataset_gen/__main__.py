"""Command line: `python -m dataset_gen generate | benchmark | inspect`."""

from __future__ import annotations

import argparse
import json
import sys

from carillon import cli
from carillon.arguments import (
    Parser,
    non_negative_number,
    number_of_workers,
    poisson_ratio,
    positive_number,
    whole_number,
)
from carillon.errors import UserError
from carillon.fem.element import DEFAULT_POISSON
from carillon.progress import say
from dataset_gen import benchmark, ranks, summary
from dataset_gen.generate import Engine, engine_of, generate_file
from dataset_gen.objectives import DATASET_OBJECTIVES, DEFAULT_OBJECTIVE, OBJECTIVES
from dataset_gen.sampling import DISTRIBUTIONS
from dataset_gen.settings import settings_of
from dataset_gen.shards import origin_of
from dataset_gen.speed import Speed
from dataset_gen.tasks import Plan

PROGRAM = "dataset_gen"

MOST_TIMED = 1_000_000
"""Samples that a benchmark keeps in memory."""


def _parser() -> Parser:
    parser = Parser(prog=PROGRAM, description="Training data of the coarsening forests.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    make = commands.add_parser("generate", help="draw and fit blocks, write one shard")
    make.add_argument("--samples", type=whole_number(1), required=True, help="of all shards")
    make.add_argument("--seed", type=whole_number(0), default=0)
    make.add_argument("--shard", type=whole_number(0), default=0, help="number of this shard")
    make.add_argument("--shards", type=whole_number(1), default=1, help="number of all shards")
    make.add_argument("--objective", choices=DATASET_OBJECTIVES, default=DEFAULT_OBJECTIVE)
    make.add_argument("--poisson", type=poisson_ratio, default=DEFAULT_POISSON)
    make.add_argument("--distribution", choices=tuple(DISTRIBUTIONS), default="uniform")
    make.add_argument("--low", type=non_negative_number, help="least modulus in GPa (0 or 0.01)")
    make.add_argument("--high", type=positive_number, help="largest modulus in GPa (10 or 1000)")
    make.add_argument("--workers", type=number_of_workers, default=1, help="processes")
    make.add_argument("--out", required=True, help="HDF5 file to write")
    time = commands.add_parser("benchmark", help="fits per second of every objective")
    time.add_argument("--samples", type=whole_number(1, MOST_TIMED), default=4000)
    time.add_argument("--objective", choices=tuple(OBJECTIVES), help="this one only")
    time.add_argument("--poisson", type=poisson_ratio, default=DEFAULT_POISSON)
    time.add_argument("--json", action="store_true")
    show = commands.add_parser("inspect", help="validate and summarise a shard")
    show.add_argument("file")
    show.add_argument("--json", action="store_true")
    return parser


def _generate(arguments: argparse.Namespace, engine: Engine) -> int:
    split = (arguments.samples, arguments.shard, arguments.shards)
    settings = settings_of(
        arguments.samples,
        arguments.seed,
        arguments.shard,
        arguments.shards,
        arguments.objective,
        arguments.poisson,
        arguments.distribution,
        arguments.low,
        arguments.high,
    )
    speed = Speed()
    try:
        fitted = generate_file(arguments.out, Plan(settings), origin_of(settings, *split), engine)
    except KeyboardInterrupt:
        say(f"{arguments.out}: interrupted; the same command goes on from here")
        return cli.EXIT_INTERRUPTED
    what = f"samples {settings.start}..{settings.stop - 1}, {settings.objective}"
    if fitted is None:
        say(f"{arguments.out}: holds {what} already, nothing to do")
        return 0
    figures = speed.report(arguments.out, fitted, arguments.workers)
    say(f"{arguments.out}: {what}; {figures}")
    return 0


def _generate_anywhere(arguments: argparse.Namespace) -> int:
    comm = ranks.world()
    if comm is None:
        return _generate(arguments, engine_of(arguments.workers))

    def lead(engine: Engine) -> int:
        if arguments.workers > 1:
            raise UserError(
                f"{arguments.workers} workers on each of {comm.size} ranks: every rank is one "
                "process, ask for more ranks instead"
            )
        return _generate(arguments, engine)

    return ranks.share(comm, PROGRAM, lead)


def _arguments(argv: list[str] | None) -> argparse.Namespace | None:
    """The command line; None if it is wrong and this is one of several ranks, which has said so."""
    try:
        return _parser().parse_args(argv)
    except UserError as error:
        comm = ranks.world()
        if comm is None:
            raise
        ranks.refuse(comm, PROGRAM, error)
        return None


def main(argv: list[str] | None = None) -> int:
    """Run one command."""
    arguments = _arguments(argv)
    if arguments is None:
        return cli.EXIT_BAD_INPUT
    if arguments.command == "generate":
        return _generate_anywhere(arguments)
    if arguments.command == "benchmark":
        result = benchmark.benchmark(arguments.samples, arguments.poisson, arguments.objective)
        text = benchmark.as_text(result)
    else:
        speed = Speed()
        result = summary.describe(arguments.file)
        text = summary.as_text(result)
        first, past = result["samples"]
        say(f"read {speed.report(arguments.file, past - first)}")
    print(json.dumps(result, indent=2) if arguments.json else text)
    return 0


if __name__ == "__main__":
    sys.exit(cli.run(PROGRAM, main))
