"""Commands that make and look at training data."""

from carillon.command_line.commands import Command

COMMANDS = {
    "generate": Command(
        "dataset_gen.commands.generate", "draw and fit blocks, write one shard", ranks=True
    ),
    "inspect": Command("dataset_gen.commands.inspect", "validate and summarise a shard"),
}
