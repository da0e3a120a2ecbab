"""The study of voxels, coarse elements and finite cells by material."""

from carillon.command_line.commands import Command

COMMANDS = {
    "discretisation": Command(
        "studies.discretisation.command",
        "errors, unknowns and time of voxels, coarse elements and finite cells of one solid",
        room="solver",
    ),
}
