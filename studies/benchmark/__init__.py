"""The time table (Fig. 11): every way to a spectrum on the same solid, machine and cores."""

from carillon.command_line.commands import Command

COMMANDS = {
    "benchmark": Command(
        "studies.benchmark.command",
        "time all methods on one solid (Fig. 11)",
        ranks=True,
        room="solver",
    ),
    "benchmark-direct": Command(
        "studies.benchmark.direct_command",
        "time the factorisation and its solves beside other direct solvers",
        room="solver",
    ),
}
