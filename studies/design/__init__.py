"""What an evaluation of a sound design takes, and how optimisers compare."""

from carillon.command_line.commands import Command

COMMANDS = {
    "benchmark-design": Command(
        "studies.design.command",
        "time of an evaluation, optimisers compared",
        room="sound",
        in_room="benchmark",
    ),
}
