"""The study of thin curved walls: how near finite cells come to frequencies that no cell made."""

from carillon.command_line.commands import Command

NEEDS = ("accuracy",)

COMMANDS = {
    "thin-walls": Command(
        "studies.thin_walls.command",
        "errors of finite cells and tetrahedra on thin curved walls, over unknowns and time",
    ),
    "thin-wall-bounds": Command(
        "studies.thin_walls.bounds_command",
        "lowest ratio of frequencies of finite cells to references, over lattices",
    ),
    "thin-wall-references": Command(
        "studies.thin_walls.references_command",
        "references of thin walls made again: harmonics, polynomials and tetrahedra",
    ),
}
