"""How the solver scales over ranks: measured where there are cores, modelled beyond."""

from carillon.command_line.commands import Command

COMMANDS = {
    "scaling": Command(
        "studies.scaling.command",
        "wall time over the number of ranks, measured and modelled",
        ranks=True,
        room="solver",
    ),
    "speed-up": Command(
        "studies.scaling.speed_up",
        "modelled speed-up on many ranks and what limits it, without a run",
    ),
}
