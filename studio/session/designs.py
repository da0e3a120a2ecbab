"""Designs of the present material, and projects that are saved with theirs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from carillon.errors import UserError
from studio.session.document import Material
from studio.session.state import StudioState


async def designed(state: StudioState) -> str:
    """The file of the present material's design, which is made if there is none.

    Raises
    ------
    UserError
        If there is nothing to make one of.
    """
    if state.is_searching:
        raise UserError("the search goes on; stop it first")
    if state.solid.project is None:
        raise UserError("there is no target with a clip yet, and so no design")
    material = state.document.material
    given: str | list[float] | None = None
    rows = []
    if material is not None and material.design is None:
        given, rows = list(material.z), state.search.rows
    elif material is not None:
        given = material.design
        if await state.solid.ask("is_of_targets", given):
            return str(given)
    out = str(state.workspace.new_design())
    made = Material(tuple(await state.solid.ask("design", given, out, rows)), out)
    if state.document.material == material:
        state.history.replace(replace(state.document, material=made))
        state.changed()
    return out


async def save(state: StudioState, name: str) -> None:
    """Write the project and its design, as the command line has them.

    Raises
    ------
    UserError
        If there is nothing to save yet, a search goes on, or files of this name are not the
        studio's to write: links for instance.  Nothing has been written then.
    """
    document = state.document
    if document.mesh is None:
        raise UserError("there is no solid yet; open one first")
    document.project(state.workspace.folder)
    state.workspace.require_savable(name)
    if document.material is not None:
        design = await designed(state)
        state.workspace.write_design(name, Path(design))
    state.workspace.write_project(name, state.document.described())
    state.name, state.saved = name, state.document
    state.changed()
