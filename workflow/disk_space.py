"""Folders for results, and whether there is room in them; a job on a full disk cannot say so."""

import os
import tempfile
from pathlib import Path

from carillon.command_line.progress import say
from carillon.errors import UserError
from carillon.files.paths import cause

ENOUGH = 1 << 20
"""Least free bytes of a disk; a run can do nothing with less."""
MODULES = ".snakemake/pip-deployments"
"""Folders in which Snakemake and scripts of its rules look for modules, below that of a run."""


def make_folder(folder: Path) -> None:
    """Make a folder for results, and those that it is in, unless it is there.

    Raises UserError if that is not possible.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{folder}: cannot be made ({cause(error)}); name another folder") from None


def require_own(folder: Path) -> None:
    """Check that nothing in a folder of results leads a run out of it, or into code of others.

    Raises UserError if there is a link anywhere in it, or a folder from which Snakemake would load
    modules.
    """
    if (folder / MODULES).exists():
        raise UserError(
            f"{folder / MODULES}: holds modules that would be run; remove it, or name another one"
        )
    for place, folders, files in os.walk(folder):
        for name in sorted((*folders, *files)):
            path = Path(place, name)
            if path.is_symlink():
                raise UserError(
                    f"{path}: is a link, expected files and folders of a run alone; remove it, or "
                    "name another folder"
                )


def require_place(folder: Path, what: str) -> None:
    """Check that a folder for results is there or can be made.

    Raises UserError if something else is there, or nothing can be written where it would be made.

    `what`: names it, for messages.
    """
    try:
        there = next(each for each in (folder, *folder.parents) if each.exists())
        if not there.is_dir():
            raise UserError(f"{what}: {there} is no folder; name another")
        with tempfile.TemporaryFile(dir=there):
            pass
    except OSError as error:
        raise UserError(
            f"{what}: {folder} cannot be written ({cause(error)}); name another folder"
        ) from None


def check_disk(folder: Path) -> None:
    """Say in a sentence that no megabyte can be written to `folder`, if that is so."""
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(ENOUGH))
            file.flush()
            os.fsync(file.fileno())
    except FileNotFoundError:  # No job has made it yet.
        pass
    except OSError as error:
        say(f"{folder}: cannot be written ({cause(error)})")
