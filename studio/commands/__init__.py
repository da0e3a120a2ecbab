"""Commands of the studio."""

from carillon.commands import Command

COMMANDS = {
    "studio": Command(
        "studio.commands.studio", "design sounds in the browser: pick, drop a clip, strike, listen"
    ),
}
