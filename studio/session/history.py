"""Undo and redo by snapshots: what was done, and the documents before and after it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from studio.session.document import Document, as_json, from_json

LONGEST = 200
"""Steps that can be undone."""


@dataclass
class History:
    """The present document, those before it and those that were undone.

    Attributes
    ----------
    document
        The present one.
    before, after
        Names of what was done and the documents that undo and redo lead to; the last one comes
        first.
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
            "document": as_json(self.document),
            "before": [[name, as_json(document)] for name, document in self.before],
            "after": [[name, as_json(document)] for name, document in self.after],
        }

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> History:
        """What `as_json` gave; errors as those of `studio.session.document.from_json`."""
        return cls(
            from_json(values["document"]),
            [(str(name), from_json(each)) for name, each in values["before"]],
            [(str(name), from_json(each)) for name, each in values["after"]],
        )
