"""Documents of a mesh, and what moves with it where its unit or what points up is changed."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.fem.geometry.turning import turned_back, turned_points, up_of_format
from sound.strikes import Strike
from studio.rows import KINDS, Row, rows_of
from studio.session.document import Document

DIGITS = 9
"""Significant digits of coordinates that are moved."""
_AXIS = re.compile(r"\b[xyz]\b")


def mesh_document(mesh: str, settings: Mapping[str, Any]) -> Document:
    """The document of a mesh with some settings; where they do not say what points up, its format.

    Examples
    --------
    >>> mesh_document("bar.glb", {"unit": 0.001}).settings
    {'mesh': 'bar.glb', 'up': 'y', 'unit': 0.001}
    """
    axis = up_of_format(mesh)
    told = {} if axis is None else {"up": axis}
    return Document({"mesh": mesh, **told, **settings})


def moved_with_mesh(
    document: Document, strikes: Mapping[str, Strike], changes: Mapping[str, Any]
) -> Document:
    """The document whose targets, regions and supports stay on the solid that changes.

    Those of its settings are to be `changes`, of which `unit` and `up` count. A target keeps its
    vertex, which the `strikes` by names of targets tell; places [m] of regions and supports are
    turned and scaled.
    """
    before = document.settings
    move = _Move(
        (changes.get("unit") or before.get("unit") or 1.0) / (before.get("unit") or 1.0)
        if "unit" in changes
        else 1.0,
        before.get("up"),
        changes["up"] if "up" in changes else before.get("up"),
    )
    if move.is_none:
        return document
    targets = document.targets
    if move.turns:
        targets = tuple(
            replace(each, at=None, vertex=strikes[each.name].vertex)
            if each.at is not None and each.name in strikes
            else each
            for each in targets
        )
    rows = {
        kind: [move.row(each) for each in rows_of(before, kind)]
        for kind in KINDS
        if before.get(kind)
    }
    return replace(document, targets=targets, settings={**before, **rows})


@dataclass(frozen=True)
class _Move:
    """A factor on lengths, and the axes that pointed up before and do so after."""

    factor: float
    before: str | None
    after: str | None

    @property
    def turns(self) -> bool:
        return (self.before or "z") != (self.after or "z")

    @property
    def is_none(self) -> bool:
        return self.factor == 1.0 and not self.turns

    def turned(self, points: Array) -> Array:
        return turned_points(turned_back(points, self.before), self.after)

    def row(self, row: Row) -> dict[str, Any]:
        """A region or support whose places have moved."""
        moved = dict(row)
        for key in ("at", "pith"):
            if moved.get(key) is not None:
                moved[key] = self._points([moved[key]])[0]
        for key in ("grain", "radial"):
            if moved.get(key) is not None:
                moved[key] = _rounded(self.turned(np.array([moved[key]], dtype=float)))[0]
        if moved.get("box") is not None:
            corners = np.array(self._points(moved["box"]))
            moved["box"] = np.sort(corners, axis=0).tolist()
        if moved.get("painted"):
            dabs = np.array(moved["painted"], dtype=float)
            radii = _rounded(self.factor * dabs[:, 3:])
            places = self._points(dabs[:, :3])
            moved["painted"] = [[*place, *radius] for place, radius in zip(places, radii)]
        for key in ("radius", "depth"):
            if moved.get(key) is not None:
                moved[key] = float(f"{self.factor * moved[key]:.{DIGITS}g}")
        if moved.get("along") is not None:
            moved["along"] = self._axes(moved["along"])
        where = moved.get("where")
        if where is not None and not where.startswith("region:"):
            moved["where"] = _AXIS.sub(lambda found: self._former(found[0]), where)
        return moved

    def _points(self, points: Any) -> list[list[float]]:
        return _rounded(self.factor * self.turned(np.array(points, dtype=float)))

    def _axes(self, axes: str) -> str:
        there = np.array([[axis in axes for axis in "xyz"]], dtype=float)
        return "".join(axis for axis, own in zip("xyz", self.turned(there)[0]) if own)

    def _former(self, axis: str) -> str:
        """A coordinate as it was, in terms of those that are."""
        unit = np.array([[float(axis == each) for each in "xyz"]])
        (component,) = self.turned(unit)
        name = "xyz"[int(np.argmax(np.abs(component)))]
        sign = "-" if component.sum() < 0.0 else ""
        scale = f" / {self.factor:g}" if self.factor != 1.0 else ""
        return f"({sign}{name}{scale})" if sign or scale else name


def _rounded(values: Array) -> list[list[float]]:
    rounded: list[list[float]] = np.array(
        [[float(f"{value:.{DIGITS}g}") for value in row] for row in np.atleast_2d(values)]
    ).tolist()
    return rounded
