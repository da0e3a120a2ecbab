"""Projects and designs of a workspace: opened when the studio starts, and saved."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

from carillon.errors import UserError
from carillon.files import atomic_path

if TYPE_CHECKING:
    from studio.session.studio import DesignStudio


async def save(studio: DesignStudio, name: str) -> None:
    """Write the project and its design, as the command line has them.

    Raises
    ------
    UserError
        If there is nothing to save yet, or a search goes on.
    """
    document = studio.document
    if document.mesh is None:
        raise UserError("there is no solid yet; open one first")
    document.project(studio.workspace.folder)
    if document.material is not None:
        design = await studio.designed()
        with atomic_path(studio.workspace.design(name)) as temporary:
            shutil.copyfile(design, temporary)
    studio.workspace.write_project(name, studio.document.described())
    studio.is_saved_as(name)
