"""What all commands with `--out`, `--plot` and `--pictures` check before they begin."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from carillon.errors import UserError
from carillon.files.paths import require_writable

FORMATS = (".png", ".svg", ".pdf")


def require_plottable(path: str | Path) -> Path:
    """Raise UserError unless `path` ends as a picture does."""
    path = Path(path)
    if path.suffix.lower() not in FORMATS:
        raise UserError(f"{path}: a picture's name ends with {', '.join(FORMATS)}")
    return path


def require_outputs(arguments: argparse.Namespace, inputs: Sequence[str | Path] = ()) -> None:
    """Check that results can be written, and not in the place of what they are made from.

    `arguments` has `out`, `plot`, `pictures`, some or none of them: names of files, None if none is
    to be written. `inputs` are names of the files that are read.

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
