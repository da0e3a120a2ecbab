"""Regions and supports of a document: rows as the page edits them, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any

from carillon.builtin_names import BUILTIN_PREFIX
from carillon.composition.entries import Dab, RegionEntry, SupportEntry
from carillon.composition.materials import named_material
from carillon.composition.places import Expression
from carillon.errors import UserError
from carillon.parameters import OneOf
from carillon.parameters.documents import parameters_from
from carillon.parameters.model import Within
from studio.interface import NotFoundError
from studio.rows import KINDS, MODELS, Row, is_complete, rows_of
from studio.session.document import Document
from studio.session.state import StudioState

Kind = Annotated[str, OneOf(*KINDS)]
Number = Annotated[int, Within(ge=0, le=1000), "a row of the table"]
Dabs = Annotated[tuple[Dab, ...], Within(min_length=1, max_length=2000)]

DIGITS = 6
"""Digits of painted places that are kept."""
_TOLD_BY_REGIONS = ("poisson", "density")
"""Settings that regions take the place of."""


def add_row(state: StudioState, kind: Kind, row: dict[str, Any]) -> None:
    """Add a region, or a support, after the others."""
    rows = rows_of(state.document.settings, kind)
    _take(state, f"add {_called(kind, row)}", kind, [*rows, _own(state, row)], len(rows))


def change_row(state: StudioState, kind: Kind, number: Number, changes: dict[str, Any]) -> None:
    """Change keys of a region or support; those that become null are left out of it."""
    rows = rows_of(state.document.settings, kind)
    before = _row(rows, number)
    both = {**before, **_own(state, changes)}
    rows[number] = {key: value for key, value in both.items() if value is not None}
    document = state.document
    if kind == "regions" and isinstance(changes.get("name"), str):
        document = _renamed(document, before["name"], changes["name"])
    _take(state, f"change {_called(kind, before)}", kind, rows, number, document)


def remove_row(state: StudioState, kind: Kind, number: Number) -> None:
    """Remove a region or support."""
    rows = rows_of(state.document.settings, kind)
    removed = _row(rows, number)
    del rows[number]
    _take(state, f"remove {_called(kind, removed)}", kind, rows)


def move_row(state: StudioState, kind: Kind, number: Number, to: Number) -> None:
    """Put a region or support at another place of the list: of regions, later ones count."""
    rows = rows_of(state.document.settings, kind)
    moved = _row(rows, number)
    _row(rows, to)
    rows.insert(to, rows.pop(number))
    _take(state, f"move {_called(kind, moved)}", kind, rows)


def paint(state: StudioState, kind: Kind, number: Number, dabs: Dabs) -> None:
    """Paint places of the surface as a region or support; negative radii take paint away."""
    rows = rows_of(state.document.settings, kind)
    row = _row(rows, number)
    if "painted" not in row:
        raise UserError(f"{_called(kind, row)} is placed in another way; choose painted for it")
    added = [[float(f"{value:.{DIGITS}g}") for value in dab] for dab in dabs]
    painted = [*row["painted"], *added]
    # What is taken away where nothing is painted yet is nothing.
    while painted and painted[0][3] <= 0.0:
        del painted[0]
    rows[number] = {**row, "painted": painted}
    _take(state, f"paint {_called(kind, row)}", kind, rows, number)


def _take(
    state: StudioState,
    step: str,
    kind: str,
    rows: Sequence[Row],
    number: int | None = None,
    document: Document | None = None,
) -> None:
    """Go on with other rows; the one of a `number` is checked by itself first."""
    if number is not None:
        require_sound(kind, rows[number])
    document = document or state.document
    if document.mesh is None:
        raise UserError("there is no solid yet; open one first")
    settings = {**document.settings, kind: list(rows)}
    if kind == "regions" and rows:
        settings = _without_what_regions_tell(settings)
    state.do(step, replace(document, settings=settings))


def require_sound(kind: str, row: Row) -> None:
    """Check a row as far as it can be without the solid; raises UserError with one sentence."""
    given = dict(row)
    if not is_complete(row):
        # Nothing is painted yet, which it may be any moment.
        given = {**row, "painted": [[0.0, 0.0, 0.0, 1.0]]}
    entry = parameters_from(given, MODELS[kind])
    if isinstance(entry, RegionEntry):
        entry.row()
        entry.axes()
    if isinstance(entry, SupportEntry) and entry.pad is not None:
        named_material(entry.pad)
    if entry.where is not None and not entry.where.startswith("region:"):
        Expression(entry.where)


def _without_what_regions_tell(settings: Mapping[str, Any]) -> dict[str, Any]:
    kept = {key: value for key, value in settings.items() if key not in _TOLD_BY_REGIONS}
    if "material" in kept:
        kept["material"] = {k: v for k, v in kept["material"].items() if k != "young"}
    return kept


def _renamed(document: Document, before: str, after: str) -> Document:
    """The document whose supports name a region by its new name."""
    supports = [
        {**row, "where": f"region:{after}"} if row.get("where") == f"region:{before}" else row
        for row in rows_of(document.settings, "supports")
    ]
    if not supports:
        return document
    return replace(document, settings={**document.settings, "supports": supports})


def _row(rows: Sequence[Row], number: int) -> Row:
    if not number < len(rows):
        raise NotFoundError(f"there is no row {number + 1}; it may have been removed")
    return rows[number]


def _own(state: StudioState, row: Row) -> dict[str, Any]:
    """A row whose mesh is a file of the workspace, in place of an identifier."""
    mesh, labels = row.get("mesh"), row.get("labels")
    if labels is not None:
        raise NotFoundError(f"there are no labels {labels!r:.100}; name them in the project's file")
    if mesh is None or (isinstance(mesh, str) and mesh.startswith(BUILTIN_PREFIX)):
        return dict(row)
    if not isinstance(mesh, str) or mesh not in state.meshes:
        raise NotFoundError(f"there is no mesh {mesh!r:.100}; add it again")
    return {**row, "mesh": state.meshes[mesh]}


def _called(kind: str, row: Row) -> str:
    return f"region {row.get('name')}" if kind == "regions" else "support"
