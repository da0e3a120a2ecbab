"""How many blocks a second every objective fits."""

from carillon.command_line.commands import Command

COMMANDS = {
    "benchmark-fits": Command(
        "studies.fits.command",
        "fits per second of every objective",
        room="dataset_gen",
        in_room="benchmark",
    ),
}
