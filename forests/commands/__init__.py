"""Commands that train, compare and time forests."""

from carillon.command_line.commands import Command

COMMANDS = {
    "train": Command("forests.commands.train", "train forests, write the model", ranks=True),
    "grow": Command("forests.commands.grow", "grow one tree, for a job of its own", ranks=True),
    "inspect": Command("forests.commands.inspect", "validate and summarise forests"),
}
