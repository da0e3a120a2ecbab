"""Another point of a solid at which a strike comes nearer to a clip.

Its modes stay the same wherever it is struck; how loud each of them is does not.
"""

from __future__ import annotations

import numpy as np

from carillon.arrays import Array, Integers
from solver.response.vertices import inward_normals
from sound.project.design import Design
from sound.rendering.likeness import Likeness
from sound.rendering.listening import Listening
from sound.rendering.solid import SoundingSolid
from sound.strikes import longest_side

MOST_POINTS = 2_000
"""Greatest number of vertices whose balance of partials is compared."""
HEARD_POINTS = 8
"""Number of points that are rendered, those whose balance is nearest to the clip's."""
APART = 0.05
"""Least distance between two of them, over the surface's longest side."""
WORTHWHILE = 0.8
"""Greatest excess of a point that is better over that of the struck one, see `Likeness.excess`."""


def better_point(
    design: Design,
    solid: SoundingSolid,
    listening: Listening,
    target: int,
    clip: Array,
    rate: int,
    now: Likeness,
) -> tuple[Array, Likeness] | None:
    """A point (3,) [m] where the strike of a target is nearer to its clip (s,) than `now`, if any.

    Of the vertices whose balance of energies is nearest to the clip's, it is the one whose sound
    is; the points of the other targets are no choice.  Raises ValueError if the clip is silent.
    """
    import trimesh

    surface = trimesh.Trimesh(design.surface_vertices, design.surface_faces, process=False)
    chosen = np.unique(np.linspace(0, len(surface.vertices) - 1, MOST_POINTS).astype(int))
    positions = np.asarray(surface.vertices)[chosen]
    inward = inward_normals(surface, positions)
    shares = _shares(solid.amplitudes(positions, inward), solid.dampings)
    targets = design.targets
    aims = _shares(targets.amplitudes[target], targets.dampings)
    # Hellinger's distance: no logarithm of a mode that does not sound.
    away = np.linalg.norm(np.sqrt(shares) - np.sqrt(aims), axis=1)
    least = APART * longest_side(surface)
    others = [each.position for row, each in enumerate(design.strikes) if row != target]
    found = [
        (
            positions[row],
            Likeness.of_strike(
                now.target, positions[row], inward[row], solid, listening, clip, rate
            ),
        )
        for row in _apart(positions, np.argsort(away, kind="stable"), others, least)
    ]
    best = min(found, key=lambda each: each[1].excess, default=None)
    return best if best is not None and best[1].excess <= WORTHWHILE * now.excess else None


def _shares(amplitudes: Array, dampings: Array) -> Array:
    """Shares (..., k) of modes in the energy of a strike."""
    energies = amplitudes**2 / np.maximum(dampings, 1e-9)
    return np.asarray(energies / np.maximum(energies.sum(axis=-1, keepdims=True), 1e-300))


def _apart(positions: Array, order: Integers, taken: list[Array], least: float) -> list[int]:
    """Numbers of the first positions of an order that are apart from each other and from some."""
    rows: list[int] = []
    for row in order:
        near = [*taken, *(positions[each] for each in rows)]
        if all(np.linalg.norm(positions[row] - each) >= least for each in near):
            rows.append(int(row))
        if len(rows) == HEARD_POINTS:
            break
    return rows
