"""What pages may ask the studio to do; each call checks what it is given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from carillon.errors import UserError
from carillon.fem.geometry.surface import BUILTIN_PREFIX, surface_name
from sound.project.schema import check, project_schema
from studio.interface import NotFoundError
from studio.session.document import Document, Material, Target, document_of, files_of, merged
from studio.session.examples import EXAMPLES
from studio.session.files import save
from studio.session.workspace import Workspace

if TYPE_CHECKING:
    from studio.session.studio import DesignStudio


class Calls:
    """Calls by name, for a studio."""

    def __init__(self, studio: DesignStudio) -> None:
        self._studio = studio

    async def call(self, name: str, arguments: Mapping[str, Any]) -> None:
        """Do what is asked for.

        Raises
        ------
        UserError
            If that cannot be done, with one sentence.
        """
        done = getattr(self, f"_{name}")(**arguments)
        if done is not None:
            await done

    def _open_mesh(self, mesh: str, unit: float = 1.0) -> None:
        file = mesh if mesh.startswith(BUILTIN_PREFIX) else self._studio.meshes.get(mesh)
        if file is None:
            raise NotFoundError(f"there is no mesh {mesh!r}; add it again")
        settings: dict[str, Any] = {"mesh": file}
        if unit != 1.0:
            settings["unit"] = unit
        self._studio.open(fit_name(surface_name(file)), Document(settings))

    def _open_project(self, project: str) -> None:
        kind, number = project[:1], project[1:]
        workspace = self._studio.workspace
        listed = {"e": EXAMPLES, "p": workspace.projects()}.get(kind, ())
        if not (number.isascii() and number.isdigit() and 1 <= int(number) <= len(listed)):
            raise NotFoundError(f"there is no project {project!r}; see which ones are listed")
        if kind == "e":
            example = EXAMPLES[int(number) - 1]
            self._studio.open(example.name, example.open(workspace))
            return
        name = workspace.projects()[int(number) - 1]
        document = opened(workspace, name)
        self._studio.open(name, document)
        self._studio.saved = self._studio.document

    async def _save(self, name: str) -> None:
        await save(self._studio, name)

    def _add_target(self, vertex: int, name: str | None = None, clip: str | None = None) -> None:
        document = self._studio.document
        self._require_free(vertex)
        named = name if name is not None else _free_name(document)
        target = Target(named, vertex=vertex, clip=self._file(clip))
        changed = replace(document, targets=(*document.targets, target))
        self._studio.do(f"add target {named}", changed)

    def _change_target(self, target: str, **changes: Any) -> None:
        document = self._studio.document
        before = document.target(target)
        if "clip" in changes:
            changes["clip"] = self._file(changes["clip"])
            if changes["clip"] != before.clip:
                changes.setdefault("without", ())
        if changes.get("vertex") is not None:
            self._require_free(changes["vertex"], target)
            changes["at"] = None
        if "without" in changes:
            changes["without"] = tuple(changes["without"])
        changed = document.with_target(target, replace(before, **changes))
        self._studio.do(f"change target {target}", changed)

    def _remove_target(self, target: str) -> None:
        changed = self._studio.document.with_target(target, None)
        self._studio.do(f"remove target {target}", changed)

    def _change_settings(self, settings: Mapping[str, Any]) -> None:
        schema = project_schema()
        parts = {k: v for k, v in schema["properties"].items() if k not in ("mesh", "targets")}
        check(settings, {**schema, "properties": parts, "required": []})
        if settings.get("forest") is not None:
            self._studio.workspace.path(settings["forest"])
        document = self._studio.document
        changed = replace(document, settings=merged(document.settings, settings))
        self._studio.do("change settings", changed)

    def _optimise(self) -> None:
        self._studio.begin_search()

    def _stop(self) -> None:
        self._studio.stop_search()

    def _undo(self) -> None:
        self._studio.move(forwards=False)

    def _redo(self) -> None:
        self._studio.move(forwards=True)

    def _forget_material(self) -> None:
        self._studio.do("forget material", replace(self._studio.document, material=None))

    def _fine(self, on: bool) -> None:
        self._studio.show_fine(bool(on))

    def _keep(self) -> None:
        document = self._studio.document
        if document.mesh is None:
            raise UserError("there is no solid yet whose material could be kept; open one first")
        kept = replace(document, kept=document.material, heard="B")
        self._studio.do("keep material", kept)

    def _swap(self) -> None:
        document = self._studio.document
        if document.heard is None:
            raise UserError("no material is kept yet; keep one first")
        other = "B" if document.heard == "A" else "A"
        swapped = replace(document, material=document.kept, kept=document.material, heard=other)
        self._studio.is_searching = False
        self._studio.do("swap materials", swapped)

    def _file(self, clip: str | None) -> str | None:
        return None if clip is None else self._studio.clips.named(clip).file

    def _require_free(self, vertex: int, target: str | None = None) -> None:
        """Refuse a vertex that the surface has not, or that another target is at."""
        bench = self._studio.bench
        count = None if bench.news is None else bench.news.vertices
        if count is None:
            raise UserError("there is no solid yet to place a target on; open one first")
        if not isinstance(vertex, int) or not 0 <= vertex < count:
            raise UserError(f"there is no vertex {vertex!r}, the surface has {count:,} of them")
        for other in self._studio.document.targets:
            strike = bench.strikes.get(other.name)
            taken = other.vertex if strike is None else strike.vertex
            if taken == vertex and other.name != target:
                raise UserError(f"the target {other.name!r} is at this point; choose another")


def opened(workspace: Workspace, name: str) -> Document:
    """The document of a project of the workspace, with its design if there is one.

    Raises
    ------
    UserError
        If it is none, or names files outside of the workspace.
    """
    described = workspace.read_project(name)
    check(described, project_schema())
    document = document_of(described)
    for file in files_of(document):
        workspace.path(file)
    return with_design(document, workspace.design(name))


def with_design(document: Document, design: Path) -> Document:
    """The document with the material of a design's file, if there is one."""
    return replace(document, material=Material((), str(design)) if design.is_file() else None)


def _free_name(document: Document) -> str:
    names = {target.name for target in document.targets}
    return next(name for k in range(1, 1000) if (name := f"target {k}") not in names)


def fit_name(name: str) -> str:
    """A name of a project, from any text."""
    plain = "".join(c if c.isascii() and (c.isalnum() or c in "-_") else "-" for c in name)
    return plain.strip("-")[:40] or "solid"
