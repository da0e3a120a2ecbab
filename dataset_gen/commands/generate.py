"""Draw random blocks, fit a coarse element to each, and write them to one shard.

A shard that was begun goes on where it stopped.  Its bytes do not depend on the number of workers,
of MPI ranks, or of interruptions: mpiexec -n RANKS python -m mpi4py -m dataset_gen generate ...
"""

from __future__ import annotations

import argparse

from carillon import cli
from carillon.arguments import (
    non_negative_number,
    number_of_workers,
    poisson_ratio,
    positive_number,
    whole_number,
)
from carillon.errors import UserError
from carillon.fem.element import DEFAULT_POISSON
from carillon.progress import say
from carillon.ranks import world
from dataset_gen import ranks
from dataset_gen.generate import Engine, engine_of, generate_file
from dataset_gen.objectives import DATASET_OBJECTIVES, DEFAULT_OBJECTIVE
from dataset_gen.sampling import DISTRIBUTIONS
from dataset_gen.settings import settings_of
from dataset_gen.shards import origin_of
from dataset_gen.speed import Speed
from dataset_gen.tasks import Plan

PROGRAM = "dataset_gen generate"
EXAMPLES = """examples:
  generate --samples 100000 --seed 1 --out shard.h5
  generate --samples 1000000 --seed 1 --shard 3 --shards 16 --workers 8 --out shard-3.h5
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("--samples", type=whole_number(1), required=True, help="of all shards")
    parser.add_argument("--seed", type=whole_number(0), default=0, help="(default 0)")
    parser.add_argument("--shard", type=whole_number(0), default=0, help="number of this shard")
    parser.add_argument("--shards", type=whole_number(1), default=1, help="number of all shards")
    parser.add_argument("--objective", choices=DATASET_OBJECTIVES, default=DEFAULT_OBJECTIVE)
    parser.add_argument("--poisson", type=poisson_ratio, default=DEFAULT_POISSON)
    parser.add_argument("--distribution", choices=tuple(DISTRIBUTIONS), default="uniform")
    parser.add_argument("--low", type=non_negative_number, help="least modulus [GPa] (0 or 0.01)")
    parser.add_argument("--high", type=positive_number, help="largest modulus [GPa] (10 or 1000)")
    parser.add_argument("--workers", type=number_of_workers, default=1, help="processes")
    parser.add_argument("--out", required=True, help="HDF5 file to write")


def run(arguments: argparse.Namespace) -> int:
    """Make the shard, with the other ranks of the job if there are any."""
    comm = world()
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
