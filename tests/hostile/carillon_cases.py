"""Rows of `python -m carillon`."""

from __future__ import annotations

from tests.hostile.cases import Table

TABLE = Table("carillon")
hostile, control = TABLE.hostile, TABLE.control

hostile("an argument", "modes", "modes")
hostile("an unknown option", "--yaml", "--yaml")
hostile("an option with a value", "--json=yes", "--json")
hostile("a line break", ["--js\non"])
hostile("bytes that are no text", ["\udcff\udcfe"])
hostile("megabytes", ["x" * 100_000])
control("no argument", "")
control("JSON", "--json")
