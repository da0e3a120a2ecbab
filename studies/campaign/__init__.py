"""Validations of many solids, materials, seeds and ranks, judged together."""

from carillon.command_line.commands import Command

COMMANDS = {
    "campaign": Command(
        "studies.base.page_command", "page: validations of solids, materials, seeds and ranks"
    ),
}
