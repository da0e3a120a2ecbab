"""What a step of a design costs by each method, where one part of a solid is painted."""

from carillon.command_line.commands import Command

COMMANDS = {
    "painted": Command(
        "studies.painted.command",
        "seconds of a step where one part of a solid is painted again and again, by method",
        room="solver",
    ),
}
