"""A place far away where a solid is heard."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError

RADIATIONS = ("sphere", "boundary-elements")
"""How a surface may move the air: as that of a sphere of its size, or as it is."""
NEAREST = 2.0
"""Least distance of a place from the middle of a solid, over that of its farthest point."""


@dataclass(frozen=True)
class FarPlace:
    """A place (3,) [m] in the coordinates of a solid where it is heard, and whether its surface
    moves the air as that of a sphere does, or by boundary elements."""

    at: Array
    by_elements: bool = False

    @classmethod
    def of(cls, at: Sequence[float] | None, unit: float, radiation: str) -> FarPlace | None:
        """The place at a position in a unit [m], by one of `RADIATIONS`; None without one."""
        if at is None:
            return None
        return cls(unit * np.array(at, dtype=float), radiation == RADIATIONS[1])

    def require_far(self, vertices: Array) -> None:
        """Raise UserError if it is near to a surface of vertices (V, 3) [m]."""
        middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
        distance = float(np.linalg.norm(self.at - middle))
        least = NEAREST * float(np.linalg.norm(vertices - middle, axis=1).max())
        if distance < least:
            raise UserError(
                f"listen.at: lies {distance:.3g} m from the middle of the solid, expected at least "
                f"{least:.3g} m, {NEAREST:g} times as far as the solid reaches, since sound is "
                "computed as it is heard from far away; name a place in the same direction"
            )
