"""What all commands with `--out`, `--plot` and `--pictures` check before they begin."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from carillon.files import require_writable
from carillon.pictures import require_plottable


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
        See `carillon.places.require_writable`, and for a picture whose format is unknown.
    """
    given = vars(arguments)
    if given.get("plot") is not None:
        require_plottable(given["plot"])
    for name in ("out", "plot", "pictures"):
        if given.get(name) is not None:
            require_writable(given[name], inputs)
