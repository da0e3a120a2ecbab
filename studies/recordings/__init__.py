"""How much of real recordings extraction finds, each with a page: `snakemake recordings`."""

from carillon.command_line.commands import Command

COMMANDS = {
    "recordings": Command(
        "studies.recordings.command",
        "real recordings of strikes, on which the extraction of modes is measured",
        room="workflow",
    ),
}
