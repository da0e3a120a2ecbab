"""Draw random blocks, fit a coarse element to each, and write them to one shard.

A shard that was begun goes on where it stopped.  Its bytes do not depend on the number of workers,
of MPI ranks, or of interruptions: mpiexec -n RANKS python -m mpi4py -m carillon generate ...
"""

import argparse

from carillon.command_line import exit_status
from carillon.command_line.progress import say
from carillon.errors import UserError
from carillon.parameters.command_line import add_options, collect, reader
from carillon.parameters.quantities import Workers
from carillon.processes.ranks import world
from dataset_gen.generate import Engine, engine_of, generate_file
from dataset_gen.ranks import run_on_ranks
from dataset_gen.settings import ShardOptions, settings_of
from dataset_gen.shards import origin_of
from dataset_gen.speed import Speed
from dataset_gen.tasks import ShardPlan

EXAMPLES = """examples:
  generate --samples 100000 --seed 1 --out shard.h5
  generate --samples 1000000 --seed 1 --shard 3 --shards 16 --workers 8 --out shard-3.h5
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser, ShardOptions)
    parser.add_argument("--workers", type=reader(Workers), default=1, help="processes")
    parser.add_argument("--out", required=True, help="HDF5 file to write")


def run(arguments: argparse.Namespace) -> int:
    """Make the shard, with the other ranks of the job if there are any."""
    comm = world()
    if comm is None:
        return _generate(arguments, engine_of(arguments.workers))

    def make(engine: Engine) -> int:
        if arguments.workers > 1:
            raise UserError(
                f"{arguments.workers} workers on each of {comm.size} ranks: every rank is one "
                "process, ask for more ranks instead"
            )
        return _generate(arguments, engine)

    return run_on_ranks(comm, make)


def _generate(arguments: argparse.Namespace, engine: Engine) -> int:
    options = collect(ShardOptions, arguments)
    settings = settings_of(options)
    speed = Speed()
    try:
        fitted = generate_file(
            arguments.out, ShardPlan(settings), origin_of(settings, options), engine
        )
    except KeyboardInterrupt:
        say(f"{arguments.out}: interrupted; the same command goes on from here")
        return exit_status.EXIT_INTERRUPTED
    what = f"samples {settings.start}..{settings.stop - 1}, {settings.objective}"
    if fitted is None:
        say(f"{arguments.out}: holds {what} already, nothing to do")
        return 0
    figures = speed.report(arguments.out, fitted, arguments.workers)
    say(f"{arguments.out}: {what}; {figures}")
    return 0
