"""Command line: `python -m workflow estimate | compare | digest | validate`."""

from __future__ import annotations

import sys
from importlib import import_module

from carillon import cli
from carillon.arguments import Parser

PROGRAM = "workflow"
COMMANDS = {
    "estimate": "core-hours, memory and storage of a configuration, before anything runs",
    "compare": "two folders of results side by side, and what moved beyond noise",
    "digest": "what result files say, as one number: equal for runs that found the same bits",
    "validate": "one solid against ground truth, ending at a page that says how far to trust it",
}
"""Commands; each is a package of its name with a module `command`."""


def _parser(command: str) -> Parser:
    parser = Parser(prog=PROGRAM, description="Around the rules: before, after, and for one solid.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, help_text in COMMANDS.items():
        part = commands.add_parser(name, help=help_text)
        if name == command:
            import_module(f"workflow.{name}.command").add_arguments(part)
    return parser


def main(argv: list[str] | None = None) -> int:
    """Run one command."""
    words = sys.argv[1:] if argv is None else argv
    arguments = _parser(words[0] if words else "").parse_args(words)
    status: int = import_module(f"workflow.{arguments.command}.command").run(arguments)
    return status


if __name__ == "__main__":
    sys.exit(cli.run(PROGRAM, main))
