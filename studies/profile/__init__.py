"""Where the time of the solver goes, beside what the machine can do."""

from carillon.command_line.commands import Command

COMMANDS = {
    "profile": Command(
        "studies.profile.command",
        "where the time goes, beside what the machine can do",
        room="solver",
    ),
}
