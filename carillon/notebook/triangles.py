"""Triangles of a solid as a notebook shows them: few, in a box of fixed size, in few bytes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from carillon.arrays import Array, Index, Integers

MOST_TRIANGLES = 8_000
"""Triangles that are shown at most; of more, vertices that are near each other become one."""
FINEST, COARSER = 96, 0.85
"""Steps of the longest side in which vertices become one at first, and factor on their number until
triangles are few enough."""
STEPS = 65_535
"""Into which the radius of the solid, on both sides of its middle, and the range of its values are
divided."""
LEAST_SHARE = 1e-4
"""Least value that is told from smaller ones, as a share of the greatest."""
COLOURS = 4_000
"""Steps of values whose vertices stay apart."""
DRAWN_AMPLITUDE = 0.16
"""Largest displacement that is drawn, as a share of the solid's radius."""


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangles that are shown, with values in colour and motions.

    Vertices are each others' only where they have one value: colours of cells end at their faces.
    """

    places: Array
    """(v, 3) in radii from the middle of the solid."""
    faces: Index
    """(t, 3) vertices, anticlockwise seen from outside."""
    values: Array | None = None
    """(v,) from 0 to 1; None of a solid in one colour."""
    motions: tuple[Array, ...] = ()
    """(v, 3) each, in radii, the largest of which is `DRAWN_AMPLITUDE`."""

    @classmethod
    def of_surface(cls, vertices: Array, faces: Integers) -> Triangles:
        """Triangles of a surface of vertices (v, 3) and faces (t, 3) or (t, 4), in one colour."""
        corners = np.asarray(vertices)[faces]
        return cls.of_corners(corners)

    @classmethod
    def of_corners(
        cls,
        corners: Array,
        values: Array | None = None,
        motions: Sequence[Array] = (),
    ) -> Triangles:
        """Triangles of faces by corners (f, 3 or 4, 3), values (f,) > 0, motions (f, 3 or 4, 3)."""
        sides = corners.shape[1]
        points = corners.reshape(-1, 3)
        low, high = points.min(axis=0), points.max(axis=0)
        places = points - 0.5 * (low + high)
        places = places / (float(np.linalg.norm(places, axis=1).max()) or 1.0)
        faces = np.arange(len(points)).reshape(-1, sides)
        if sides == 4:
            faces = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
        shown = None if values is None else np.repeat(_scaled(values), sides)
        drawn = tuple(_drawn(motion.reshape(-1, 3)) for motion in motions)
        return cls(places, faces, shown, drawn)._reduced()

    def _reduced(self) -> Triangles:
        """Vertices of one place and value as one, then as few triangles as are shown."""
        merged = self._merged(np.rint(STEPS * self.places))
        steps = float(FINEST)
        while len(merged.faces) > MOST_TRIANGLES:
            merged = merged._merged(np.floor(0.5 * steps * merged.places))
            steps *= COARSER
        return merged

    def _merged(self, keys: Array) -> Triangles:
        """Vertices (v,) of equal keys (v, 3) and values as one, at their mean place."""
        rows = keys.astype(np.int64) + STEPS + 1
        if self.values is not None:
            rows = np.column_stack([rows, np.rint(COLOURS * self.values).astype(np.int64)])
        _, number = np.unique(_joined(rows), return_inverse=True)
        number = number.ravel()
        count = np.bincount(number)

        def mean(rows: Array) -> Array:
            return np.stack([np.bincount(number, each) / count for each in rows.T], axis=1)

        faces = number[self.faces]
        a, b, c = faces.T
        faces = faces[(a != b) & (b != c) & (c != a)]
        return replace(
            self,
            places=mean(self.places),
            faces=_distinct(faces),
            values=None if self.values is None else mean(self.values[:, None])[:, 0],
            motions=tuple(map(mean, self.motions)),
        )

    def packed(self) -> bytes:
        """Little-endian: places (v, 3) and, if there are, values (v,), uint16; faces (t, 3),
        uint16; motions (v, 3) each, int8 of `DRAWN_AMPLITUDE`.

        Vertices are in the order in which faces name them, which makes their numbers alike.
        """
        order, first = np.unique(self.faces, return_index=True)
        order = order[np.argsort(first)]
        number = np.empty(len(self.places), dtype=np.int64)
        number[order] = np.arange(len(order))
        parts: list[np.ndarray] = [np.rint(0.5 * STEPS * (self.places[order] + 1.0)).astype("<u2")]
        if self.values is not None:
            parts.append(np.rint(STEPS * self.values[order]).astype("<u2"))
        parts.append(number[self.faces].astype("<u2"))
        for motion in self.motions:
            parts.append(np.rint(127.0 / DRAWN_AMPLITUDE * motion[order]).astype("i1"))
        return b"".join(part.tobytes() for part in parts)

    @property
    def used(self) -> int:
        """Number of vertices that faces name."""
        return len(np.unique(self.faces))


def _distinct(faces: Index) -> Index:
    """Faces of other vertices than any before."""
    _, first = np.unique(_joined(np.sort(faces, axis=1)), return_index=True)
    return faces[np.sort(first)]


def _joined(rows: Index) -> Index:
    """One number (n,) for each row (n, k) of whole numbers that are not negative.

    Columns of 17, 17, 17 and 12 bits fit, and three of 21.
    """
    joined = np.zeros(len(rows), dtype=np.int64)
    for column in rows.T:
        joined = joined * (int(column.max(initial=0)) + 1) + column
    return joined


def _scaled(values: Array) -> Array:
    """Shares (f,) of the range of logarithms of values (f,) > 0; one half if all are alike."""
    logs = np.log(np.maximum(values, LEAST_SHARE * float(values.max())))
    wide = float(np.ptp(logs))
    return np.full(len(logs), 0.5) if wide < 1e-6 else (logs - logs.min()) / wide


def _drawn(motion: Array) -> Array:
    largest = float(np.linalg.norm(motion, axis=1).max(initial=0.0))
    return motion * (DRAWN_AMPLITUDE / largest if largest > 0.0 else 0.0)
