"""Commands that make and look at training data."""

from carillon.commands import Command

COMMANDS = {
    "generate": Command(
        "dataset_gen.commands.generate", "draw and fit blocks, write one shard", ranks=True
    ),
    "benchmark": Command("dataset_gen.commands.benchmark", "fits per second of every objective"),
    "inspect": Command("dataset_gen.commands.inspect", "validate and summarise a shard"),
}
