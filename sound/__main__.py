"""Command line: `python -m sound extract | clip | design | render | export | benchmark`."""

from __future__ import annotations

import sys
from importlib import import_module

from carillon import cli
from carillon.arguments import Parser

PROGRAM = "sound"
COMMANDS = {
    "extract": ("sound.clips.command", "modes of a sound clip: frequency, damping, amplitude"),
    "clip": ("sound.clips.clip_command", "synthesise a clip of a struck metal, wood or string"),
    "design": ("sound.design.command", "optimise the material until struck points sound as clips"),
    "render": ("sound.rendering.command", "the sound of a strike, as WAV"),
    "export": ("sound.export.command", "modes on the mesh, glTF or Faust, for other tools"),
    "benchmark": ("sound.design.benchmark_command", "time of an evaluation, optimisers compared"),
}
"""Commands: module with `add_arguments` and `run`, and what they do."""


def _parser(command: str) -> Parser:
    parser = Parser(prog=PROGRAM, description="From example clips to a material to a sound.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, (module, help_text) in COMMANDS.items():
        part = commands.add_parser(name, help=help_text)
        if name == command:
            import_module(module).add_arguments(part)
    return parser


def main(argv: list[str] | None = None) -> int:
    """Run one command."""
    words = sys.argv[1:] if argv is None else argv
    arguments = _parser(words[0] if words else "").parse_args(words)
    status: int = import_module(COMMANDS[arguments.command][0]).run(arguments)
    return status


if __name__ == "__main__":
    sys.exit(cli.run(PROGRAM, main))
