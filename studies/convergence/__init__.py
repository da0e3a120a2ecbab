"""Eigenvalues after each correction, from several starts (the paper's Fig. 10)."""

from carillon.command_line.commands import Command

COMMANDS = {
    "convergence": Command(
        "studies.convergence.command",
        "eigenvalues after each correction from several starts (Fig. 10)",
        ranks=True,
        room="solver",
    ),
}
