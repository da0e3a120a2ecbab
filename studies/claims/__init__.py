"""What the paper claims, what is measured here, and why: one table and its page."""

from carillon.command_line.commands import Command

COMMANDS = {
    "claims": Command(
        "studies.base.page_command", "page: what the paper claims beside what is measured"
    ),
}
