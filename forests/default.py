"""Where the forests lie that come with the package."""

from pathlib import Path

from carillon.errors import UserError

DEFAULT_FILE = Path(__file__).parent / "default.h5"
"""Trained forests that come with the package."""


def default_path() -> Path:
    """File of the forests that come with the package.

    Raises UserError if it is not there.
    """
    if not DEFAULT_FILE.is_file():
        raise UserError(
            f"{DEFAULT_FILE}: the forests that come with Carillon are not there; install it again, "
            "or train forests and name their file"
        )
    return DEFAULT_FILE
