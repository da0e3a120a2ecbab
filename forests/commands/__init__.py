"""Commands that train, compare and time forests."""

from carillon.commands import Command

COMMANDS = {
    "train": Command("forests.commands.train", "train on shards, write the model", ranks=True),
    "grow": Command("forests.commands.grow", "grow one tree, for a job of its own"),
    "variants": Command("forests.commands.variants", "other ways to train, of equal storage"),
    "curve": Command("forests.commands.curve", "error over the rows trained on"),
    "table": Command(
        "forests.commands.table", "error, cost and storage of every coarsening (Fig. 9)"
    ),
    "benchmark": Command(
        "forests.commands.benchmark", "time of a block, of loading, over the size"
    ),
    "inspect": Command("forests.commands.inspect", "validate and summarise forests"),
}
