"""Fig. 9: forests compared with other coarsenings of single blocks, and what the errors are."""

from carillon.command_line.commands import Command

COMMANDS = {
    "table": Command(
        "studies.blocks.command",
        "error, cost and storage of every coarsening (Fig. 9)",
        room="forests",
    ),
}
