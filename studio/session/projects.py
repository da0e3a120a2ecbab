"""Projects of a workspace as documents."""

from dataclasses import replace
from pathlib import Path

from carillon.errors import UserError
from carillon.parameters.documents import parameters_from
from sound.project.project import Project
from studio.session.document import Document, Material, document_of, files_of
from studio.session.state import StudioState
from studio.session.workspace import Workspace


def opened(workspace: Workspace, name: str) -> Document:
    """The document of a project of the workspace, with its design if there is one.

    Raises UserError if it is none, or names files outside of the workspace.
    """
    described = workspace.read_project(name)
    parameters_from(described, Project)
    document = document_of(described)
    for file in files_of(document):
        workspace.path(file)
    return with_design(document, workspace.path(f"{name}.h5"))


def with_design(document: Document, design: Path) -> Document:
    """The document with the material of a design's file, if there is one."""
    return replace(document, material=Material((), str(design)) if design.is_file() else None)


def fit_name(name: str) -> str:
    """A name of a project, from any text."""
    plain = "".join(c if c.isascii() and (c.isalnum() or c in "-_") else "-" for c in name)
    return plain.strip("-")[:40] or "solid"


async def designed(state: StudioState) -> str:
    """The file of the present material's design, which is made if there is none.

    Raises UserError if there is nothing to make one of.
    """
    if state.is_searching:
        raise UserError("the search goes on; stop it first")
    if state.solid.project is None:
        raise UserError("there is no target with a clip yet, and so no design")
    material = state.document.material
    given: str | list[float] | None = None
    rows, other = [], None
    if material is not None and material.design is None:
        given, rows = list(material.z), state.search.rows
        if material == state.search.found:
            # Of a search that was stopped: it was found on the coarse solid, and not checked yet.
            other = state.search.best_checked
    elif material is not None:
        given = material.design
        if await state.solid.ask("is_of_targets", given):
            return str(given)
    out = str(state.workspace.new_design())
    made = Material(tuple(await state.solid.ask("design", given, out, rows, other)), out)
    if state.document.material == material:
        state.history.replace(replace(state.document, material=made))
        state.changed()
    return out


async def save(state: StudioState, name: str) -> None:
    """Write the project and its design, as the command line has them.

    Raises UserError if there is nothing to save yet, a search goes on, or files of this name are
    not the studio's to write: links for instance.  Nothing has been written then.
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
