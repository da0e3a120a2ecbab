"""Projects and designs of a workspace: opened when the studio starts, and saved."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from carillon.errors import UserError

if TYPE_CHECKING:
    from studio.session.studio import DesignStudio


async def save(studio: DesignStudio, name: str) -> None:
    """Write the project and its design, as the command line has them.

    Raises
    ------
    UserError
        If there is nothing to save yet, a search goes on, or files of this name are not the
        studio's to write: links for instance.  Nothing has been written then.
    """
    document = studio.document
    if document.mesh is None:
        raise UserError("there is no solid yet; open one first")
    document.project(studio.workspace.folder)
    studio.workspace.require_savable(name)
    if document.material is not None:
        design = await studio.designed()
        studio.workspace.write_design(name, Path(design))
    studio.workspace.write_project(name, studio.document.described())
    studio.is_saved_as(name)
