"""What is designed, as one immutable value, and undo and redo by snapshots of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from carillon.builtin_names import BUILTIN_PREFIX
from carillon.errors import UserError
from carillon.parameters import checked
from carillon.parameters.quantities import MetresPerUnit, WallThickness
from sound.project.project import Project, project_of
from studio.rows import complete, rows_of

NO_CLIP = "none"
_LENGTHS = {"unit": MetresPerUnit, "wall": WallThickness}
"""Settings that files may have as texts, such as mm, and pages as numbers alone."""
_ANYWHERE = {"name": "anywhere", "vertex": 0, "clip": NO_CLIP}
"""Stands for targets where a solid has none yet."""
LONGEST = 200
"""Steps that can be undone."""


@dataclass(frozen=True)
class Target:
    """A struck point and its clip; keys of a project's target, but the clip may be lacking yet."""

    name: str
    vertex: int | None = None
    at: tuple[float, float, float] | None = None
    clip: str | None = None
    modes: int | None = None
    allow_clipped: bool = False
    without: tuple[float, ...] = ()


@dataclass(frozen=True)
class Material:
    """A material by its coordinates, and the file of its design if there is one."""

    z: tuple[float, ...]
    design: str | None = None


@dataclass(frozen=True)
class Document:
    """A project under way.

    `settings` are keys of a project but `targets`, as its file has them: paths from the workspace's
    folder; empty while there is no mesh.  The present `material` is the uniform one if None, and
    `kept` is the other one of A and B, likewise; `heard` tells which of the two the present one is,
    None while no other one was kept.
    """

    settings: Mapping[str, Any]
    targets: tuple[Target, ...] = ()
    material: Material | None = None
    kept: Material | None = None
    heard: str | None = None

    @property
    def mesh(self) -> str | None:
        """As in the project: `builtin:NAME`, or a path."""
        mesh: str | None = self.settings.get("mesh")
        return mesh

    def target(self, name: str) -> Target:
        """The target of a name; raises UserError if there is none."""
        for target in self.targets:
            if target.name == name:
                return target
        raise UserError(f"there is no target {name!r}; it may have been removed or renamed")

    def with_target(self, name: str, changed: Target | None) -> Document:
        """The same with another target in the place of `name`, or without it."""
        self.target(name)
        targets = [changed if each.name == name else each for each in self.targets]
        return replace(self, targets=tuple(each for each in targets if each is not None))

    def described(self) -> dict[str, Any]:
        """The project as its file has it, without targets that have no clip, and rows no place."""
        targets = [_described(target) for target in self.targets if target.clip is not None]
        return {**complete(self.settings), "targets": targets}

    def project(self, folder: Path) -> Project:
        """The project, in a workspace's folder.

        Raises UserError with one sentence about the first thing that is wrong, if only that there
        is no clip.
        """
        return project_of(self.described(), folder)

    def solid(self, folder: Path) -> Project:
        """The project with a target that stands for those that it may have; errors likewise."""
        return project_of({**complete(self.settings), "targets": [_ANYWHERE]}, folder)

    def require_sound(self, folder: Path) -> Document:
        """The same, if it can be a project once every target has a clip.

        Raises UserError with one sentence about the first thing that is wrong.
        """
        named = [replace(target, clip=target.clip or NO_CLIP) for target in self.targets]
        targets = [_described(target) for target in named] or [_ANYWHERE]
        project_of({**complete(self.settings), "targets": targets}, folder)
        names = [target.name for target in self.targets]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise UserError(f"there is a target {twice!r} already; give this one another name")
        return self


def document_of(described: Mapping[str, Any]) -> Document:
    """The document that the keys and values of a project's file describe."""
    settings = with_plain_lengths(
        {key: value for key, value in described.items() if key != "targets"}
    )
    targets = []
    for entry in described["targets"]:
        known = {key: entry[key] for key in Target.__dataclass_fields__ if key in entry}
        if known.get("at") is not None:
            known["at"] = tuple(known["at"])
        known["without"] = tuple(known.get("without", ()))
        targets.append(Target(**known))
    return Document(settings, tuple(targets))


def with_plain_lengths(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings whose lengths are numbers [m], also those that a file has as texts.

    Examples
    --------
    >>> with_plain_lengths({"unit": "mm", "wall": "2 cm"})
    {'unit': 0.001, 'wall': 0.02}
    """
    return {
        key: checked(key, value, _LENGTHS[key])
        if key in _LENGTHS and isinstance(value, str)
        else value
        for key, value in settings.items()
    }


def merged(settings: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Settings with others on top, section by section.

    Examples
    --------
    >>> merged({"weights": {"frequency": 1.0}}, {"weights": {"amplitude": 2.0}, "modes": 8})
    {'weights': {'frequency': 1.0, 'amplitude': 2.0}, 'modes': 8}
    """
    result = dict(settings)
    for key, value in changes.items():
        known = result.get(key)
        both = isinstance(value, Mapping) and isinstance(known, Mapping)
        result[key] = {**(known or {}), **value} if both else value
    return result


def from_json(values: Mapping[str, Any]) -> Document:
    """The document that `asdict` gave.

    Raises LookupError, TypeError or ValueError if it is none.
    """
    document = document_of({**values["settings"], "targets": values["targets"]})
    material, kept = (_material(values[name]) for name in ("material", "kept"))
    return replace(document, material=material, kept=kept, heard=values.get("heard"))


def files_of(document: Document) -> list[str]:
    """Paths of all files that a document names."""
    named = [document.mesh, document.settings.get("forest")]
    named += [target.clip for target in document.targets]
    regions = rows_of(document.settings, "regions")
    named += [row.get(key) for row in regions for key in ("mesh", "labels")]
    return [name for name in named if name is not None and not name.startswith(BUILTIN_PREFIX)]


def _material(values: Mapping[str, Any] | None) -> Material | None:
    if values is None:
        return None
    return Material(tuple(float(x) for x in values["z"]), values["design"])


def _described(target: Target) -> dict[str, Any]:
    # The first vertex has the number 0, which equals False.
    values = {
        key: value
        for key, value in asdict(target).items()
        if value is not None and value is not False and value != ()
    }
    return {
        key: list(value) if isinstance(value, tuple) else value for key, value in values.items()
    }


@dataclass
class History:
    """The present document, those before it and those that were undone.

    `before` and `after` have names of what was done and the documents that undo and redo lead to;
    the last one comes first.
    """

    document: Document
    before: list[tuple[str, Document]] = field(default_factory=list)
    after: list[tuple[str, Document]] = field(default_factory=list)

    @property
    def undo_name(self) -> str | None:
        """What undo takes back."""
        return self.before[-1][0] if self.before else None

    @property
    def redo_name(self) -> str | None:
        """What redo does again."""
        return self.after[-1][0] if self.after else None

    def do(self, name: str, document: Document) -> None:
        """Go on to another document."""
        self.before.append((name, self.document))
        del self.before[:-LONGEST]
        self.after.clear()
        self.document = document

    def replace(self, document: Document) -> None:
        """Let the present document be another one, of which undo knows nothing."""
        self.document = document

    def undo(self) -> bool:
        """Go back by a step, if there is one."""
        return self._move(self.before, self.after)

    def redo(self) -> bool:
        """Do again what was undone last, if anything."""
        return self._move(self.after, self.before)

    def _move(self, source: list[tuple[str, Document]], target: list[tuple[str, Document]]) -> bool:
        if not source:
            return False
        name, document = source.pop()
        target.append((name, self.document))
        self.document = document
        return True

    def designs(self) -> set[str]:
        """Files of all designs that one may come back to."""
        documents = [self.document, *(each for _, each in (*self.before, *self.after))]
        materials = [each for document in documents for each in (document.material, document.kept)]
        return {each.design for each in materials if each is not None and each.design is not None}

    def as_json(self) -> dict[str, Any]:
        """All of it as plain values."""
        return {
            "document": asdict(self.document),
            "before": [[name, asdict(document)] for name, document in self.before],
            "after": [[name, asdict(document)] for name, document in self.after],
        }

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> History:
        """What `as_json` gave; errors as those of `studio.session.document.from_json`."""
        return cls(
            from_json(values["document"]),
            [(str(name), from_json(each)) for name, each in values["before"]],
            [(str(name), from_json(each)) for name, each in values["after"]],
        )
