"""Two folders of results side by side: what moved beyond noise, and under which conditions."""

from carillon.command_line.commands import Command

COMMANDS = {
    "compare-runs": Command(
        "studies.comparison.command",
        "two folders of results side by side, and what moved beyond noise",
        room="workflow",
        in_room="compare",
    ),
}
