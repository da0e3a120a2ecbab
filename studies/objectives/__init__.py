"""The study that chooses the fit objective by the spectra it leads to."""

from carillon.command_line.commands import Command

COMMANDS = {
    "objectives": Command(
        "studies.objectives.command",
        "spectra of one solid coarsened by every fit objective, and by forests",
        ranks=True,
        room="solver",
    ),
}
