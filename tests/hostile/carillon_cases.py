"""Rows of `carillon`, but for the commands that it shares with other programs."""

from tests.hostile.cases import Table

TABLE = Table("carillon")
hostile, control = TABLE.hostile, TABLE.control

hostile("no command", "", "COMMAND")
hostile("no such command", "mode", "mode")
hostile("an argument", "environment modes", "modes")
hostile("an unknown option", "environment --yaml", "--yaml")
hostile("an option with a value", "environment --json=yes", "--json")
hostile("a line break", ["environment", "--js\non"])
hostile("bytes that are no text", ["\udcff\udcfe"])
hostile("megabytes", ["x" * 100_000])
control("no argument", "environment")
control("JSON", "environment --json")
control("another program's command", "inspect-forests")
