"""Tell the modelled speed-up of block Lanczos on many ranks, and what limits it; nothing is run.

Solids are compact and of so many unknowns; ranks are cores of an AMD EPYC.
"""

import argparse
from typing import Annotated

from carillon.parameters.command_line import reader
from carillon.parameters.quantities import NumberOfModes, between
from solver.rank_scaling import (
    ALONE,
    ASSUMPTIONS,
    BANDWIDTH,
    LATENCY,
    modelled_seconds,
    speed_up,
)

EXAMPLES = """example:
  speed-up --unknowns 78462,251091,1000000 --ranks 4,16,64,256,1024
"""
UNKNOWNS, RANKS, MODES = (78_462, 251_091, 1_000_000), (4, 16, 64, 256, 1024), 64


def counts(text: str) -> tuple[int, ...]:
    """Argument type: numbers, separated by commas."""
    return tuple(map(reader(Annotated[int, between(1, 1_000_000_000)]), text.split(",")))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    shown = ",".join(map(str, UNKNOWNS)), ",".join(map(str, RANKS))
    parser.add_argument(
        "--unknowns", type=counts, default=UNKNOWNS, help=f"of the solids (default {shown[0]})"
    )
    parser.add_argument(
        "--ranks", type=counts, default=RANKS, help=f"numbers of ranks (default {shown[1]})"
    )
    parser.add_argument(
        "--modes", type=reader(NumberOfModes), default=MODES, help=f"(default {MODES})"
    )
    parser.add_argument(
        "--latency",
        type=reader(Annotated[float, between(1e-12, 1e3)]),
        default=LATENCY,
        help=f"of a message [s] (default {LATENCY:g})",
    )
    parser.add_argument(
        "--bandwidth",
        type=reader(Annotated[float, between(1.0, 1e18)]),
        default=BANDWIDTH,
        help=f"of the network [B/s] (default {BANDWIDTH:g})",
    )


def run(arguments: argparse.Namespace) -> None:
    """Print a line for every size and number of ranks."""
    modes, network = arguments.modes, (arguments.latency, arguments.bandwidth)
    print(
        f"{'unknowns':>12} {'ranks':>6} {'seconds':>9} {'speed-up':>9} {'of a job':>9}  most time"
    )
    for unknowns in arguments.unknowns:
        for ranks in arguments.ranks:
            seconds = modelled_seconds(unknowns, modes, ranks, *network)
            total, most = sum(seconds.values()), max(seconds, key=lambda part: seconds[part])
            solve, job = (
                speed_up(unknowns, modes, ranks, alone, *network)
                for alone in (0.0, ALONE * unknowns)
            )
            print(
                f"{unknowns:12,d} {ranks:6d} {total:9.2f} {solve:9.1f} {job:9.1f}  {most}, "
                f"{seconds[most] / total:.0%}"
            )
    print("of a job: with mesh and material, which the first rank makes alone")
    print("\n".join(f"assumed: {each}" for each in ASSUMPTIONS))
