"""Names of solids on command lines."""

import argparse

from studies.thin_walls.solids import SOLIDS, WalledSolid, solid_of_file


def solid_names(text: str) -> tuple[str, ...]:
    """Names of solids of the study, joined by commas."""
    names = tuple(dict.fromkeys(text.split(",")))
    unknown = [name for name in names if name not in SOLIDS]
    if unknown:
        raise argparse.ArgumentTypeError(
            f"{unknown[0]!r} is unknown, expected some of {', '.join(SOLIDS)}, joined by commas"
        )
    return names


def named_file(text: str) -> tuple[str, str]:
    """Name and mesh file of a solid, from ``name=FILE``."""
    name, equals, path = text.partition("=")
    if not (name and equals and path):
        raise argparse.ArgumentTypeError(f"{text!r} is no NAME=FILE")
    return name, path


def add_solids(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that say which solids are studied, see `chosen_solids`."""
    parser.add_argument(
        "--solids",
        type=solid_names,
        default=tuple(SOLIDS),
        metavar="NAMES",
        help=f"solids, joined by commas (default {','.join(SOLIDS)})",
    )
    parser.add_argument(
        "--mesh",
        dest="meshes",
        type=named_file,
        action="append",
        default=[],
        metavar="NAME=FILE",
        help="another solid, from a mesh file in metres; may be repeated",
    )


def chosen_solids(arguments: argparse.Namespace) -> dict[str, WalledSolid]:
    """Solids of the study and of mesh files by name.

    Raises UserError if a file is no use.
    """
    files = {name: solid_of_file(name, path) for name, path in arguments.meshes}
    return {name: SOLIDS[name] for name in arguments.solids} | files
