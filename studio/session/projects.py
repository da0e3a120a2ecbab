"""Projects of a workspace as documents."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from carillon.parameters.documents import parameters_from
from sound.project.project import Project
from studio.session.document import Document, Material, document_of, files_of
from studio.session.workspace import Workspace


def opened(workspace: Workspace, name: str) -> Document:
    """The document of a project of the workspace, with its design if there is one.

    Raises
    ------
    UserError
        If it is none, or names files outside of the workspace.
    """
    described = workspace.read_project(name)
    parameters_from(described, Project)
    document = document_of(described)
    for file in files_of(document):
        workspace.path(file)
    return with_design(document, workspace.design(name))


def with_design(document: Document, design: Path) -> Document:
    """The document with the material of a design's file, if there is one."""
    return replace(document, material=Material((), str(design)) if design.is_file() else None)


def fit_name(name: str) -> str:
    """A name of a project, from any text."""
    plain = "".join(c if c.isascii() and (c.isalnum() or c in "-_") else "-" for c in name)
    return plain.strip("-")[:40] or "solid"
