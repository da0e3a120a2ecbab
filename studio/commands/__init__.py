"""Commands of the studio."""

from carillon.command_line.commands import Command

COMMANDS = {
    "studio": Command(
        "studio.commands.studio", "design sounds in the browser: pick, drop a clip, strike, listen"
    ),
    "scene": Command(
        "studio.commands.scene", "solids that fall, roll and strike each other, heard and seen"
    ),
}
