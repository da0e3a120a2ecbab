"""Command line: `python -m dataset_gen generate | benchmark | inspect`."""

from __future__ import annotations

import argparse
import json
import sys
from typing import Any

from carillon import cli
from carillon.arguments import Parser, poisson_ratio, whole_number
from carillon.files import require_writable
from carillon.progress import say
from dataset_gen import benchmark, summary
from dataset_gen.element import DEFAULT_POISSON
from dataset_gen.generate import generate
from dataset_gen.objectives import DEFAULT_OBJECTIVE, OBJECTIVES
from dataset_gen.shards import write_shard


def _parser() -> Parser:
    parser = Parser(prog="dataset_gen", description="Training data of the coarsening forests.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    make = commands.add_parser("generate", help="draw and fit blocks, write one shard")
    make.add_argument("--samples", type=whole_number(1), required=True, help="of all shards")
    make.add_argument("--seed", type=whole_number(0), default=0)
    make.add_argument("--shard", type=whole_number(0), default=0, help="number of this shard")
    make.add_argument("--shards", type=whole_number(1), default=1, help="number of all shards")
    make.add_argument("--objective", choices=tuple(OBJECTIVES), default=DEFAULT_OBJECTIVE)
    make.add_argument("--poisson", type=poisson_ratio, default=DEFAULT_POISSON)
    make.add_argument("--workers", type=whole_number(1), default=1, help="processes")
    make.add_argument("--out", required=True, help="HDF5 file to write")
    time = commands.add_parser("benchmark", help="fits per second of every objective")
    time.add_argument("--samples", type=whole_number(1), default=2000)
    time.add_argument("--poisson", type=poisson_ratio, default=DEFAULT_POISSON)
    time.add_argument("--json", action="store_true")
    show = commands.add_parser("inspect", help="validate and summarise a shard")
    show.add_argument("file")
    show.add_argument("--json", action="store_true")
    return parser


def _generate(arguments: argparse.Namespace) -> None:
    require_writable(arguments.out)
    parameters: dict[str, Any] = {
        name: getattr(arguments, name)
        for name in ("samples", "seed", "shard", "shards", "objective", "poisson")
    }
    shard = generate(
        total=arguments.samples,
        seed=arguments.seed,
        shard=arguments.shard,
        shards=arguments.shards,
        objective=arguments.objective,
        poisson=arguments.poisson,
        workers=arguments.workers,
    )
    write_shard(arguments.out, shard, parameters)
    say(f"{arguments.out}: samples {shard.start}..{shard.stop - 1}, {shard.objective}")


def main(argv: list[str] | None = None) -> None:
    """Run one command."""
    arguments = _parser().parse_args(argv)
    if arguments.command == "generate":
        _generate(arguments)
        return
    if arguments.command == "benchmark":
        result = benchmark.benchmark(arguments.samples, arguments.poisson)
        text = benchmark.as_text(result)
    else:
        result = summary.describe(arguments.file)
        text = summary.as_text(result)
    print(json.dumps(result, indent=2) if arguments.json else text)


if __name__ == "__main__":
    sys.exit(cli.run("dataset_gen", main))
