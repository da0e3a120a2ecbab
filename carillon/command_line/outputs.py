"""What all commands with `--out`, `--plot` and `--pictures` check before they begin."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from carillon.command_line.picture_formats import require_plottable
from carillon.files.paths import require_writable


def require_outputs(arguments: argparse.Namespace, inputs: Sequence[str | Path] = ()) -> None:
    """Check that results can be written, and not in the place of what they are made from.

    Parameters
    ----------
    arguments
        With `out`, `plot`, `pictures`, some or none of them: names of files, None if none is to be
        written.
    inputs
        Names of the files that are read.

    Raises
    ------
    UserError
        See `carillon.files.paths.require_writable`, and for a picture whose format is unknown.
    """
    given = vars(arguments)
    if given.get("plot") is not None:
        require_plottable(given["plot"])
    for name in ("out", "plot", "pictures"):
        if given.get(name) is not None:
            require_writable(given[name], inputs)
