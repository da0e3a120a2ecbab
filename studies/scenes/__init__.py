"""Scenes of designs and bars that fall, roll and strike each other, and their page."""

from carillon.command_line.commands import Command

NEEDS = ("sounds",)

COMMANDS = {
    "scenes": Command(
        "studies.base.page_command", "page: scenes of solids that fall, roll and strike each other"
    ),
}
