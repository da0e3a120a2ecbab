"""Packages that only scenes need."""

from importlib import import_module
from typing import Any

from carillon.errors import UserError, one_line

REQUIREMENTS = "workflow/envs/requirements-scenes.txt"


def scene_package(name: str) -> Any:
    """Import a package that scenes need; only when it is needed, as that takes long.

    Raises UserError if it cannot be imported.
    """
    try:
        return import_module(name)
    except (ImportError, OSError) as error:  # OSError: a library that it needs.
        package = name.partition(".")[0]
        raise UserError(
            f"{package} cannot be loaded ({one_line(str(error))}); "
            f"install it by pip install -r {REQUIREMENTS}"
        ) from None
