"""Bodies that touch others, or themselves, along edges alone, where nothing holds them together.

Voxels and finite cells that both have a share in would join them, stiffly, wherever the lattice
happens to lie.
"""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from carillon.errors import UserError
from carillon.fem.geometry.facets import Facets, connected
from carillon.fem.geometry.overlap import common_box, distances, joined
from carillon.fem.geometry.parts import ClosedPart, closed_parts, winding_numbers
from carillon.fem.geometry.pinches import pinch

if TYPE_CHECKING:  # Its import takes long, and many commands need no surface.
    import trimesh

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Flags = NDArray[np.bool_]

TOUCHING = 1e-7
"""Distance, over the longest side, of a corner from another body up to which the two touch."""
MOST_PARTS = 100
"""Parts beyond which no contacts are sought."""


def one_body(surface: trimesh.Trimesh, components: str, name: str) -> trimesh.Trimesh:
    """The surface, without bodies that touch its largest one along edges or in points alone.

    Parameters
    ----------
    components
        ``"largest"`` leaves the others out.
    name
        Of the mesh, for messages.

    Raises
    ------
    UserError
        If there are such bodies and `components` is ``"error"``, or a body touches itself along an
        edge.
    """
    facets = Facets.of_surface(np.asarray(surface.vertices), np.asarray(surface.faces), sheets=True)
    kept = _without_others(surface, facets, components, name)
    if kept is not surface or facets.sheet.any():
        facets = Facets.of_surface(np.asarray(kept.vertices), np.asarray(kept.faces))
    middle = pinch(facets) if len(facets) else None
    if middle is not None:
        low = kept.vertices[kept.faces].min(axis=(0, 1))
        at = ", ".join(f"{x:.4g}" for x in low + kept.extents.max() * middle)
        raise UserError(
            f"mesh {name!r} touches itself along an edge at ({at}) m, where nothing holds it "
            "together; let it overlap there, or move what touches apart"
        )
    return kept


def _without_others(
    surface: trimesh.Trimesh, facets: Facets, components: str, name: str
) -> trimesh.Trimesh:
    parts = closed_parts(facets) if len(facets) and facets.patches.any() else []
    outer = [part for part in parts if part.volume > 0.0]
    if not 2 <= len(outer) <= MOST_PARTS:
        return surface
    body = _bodies(facets, outer)
    touching = [
        (body[i], body[j])
        for i, j in combinations(range(len(outer)), 2)
        if body[i] != body[j] and _touch(facets, outer[i], outer[j])
    ]
    if not touching:
        return surface
    if components == "error":
        raise UserError(
            f"mesh {name!r} falls into {body.max() + 1} pieces that touch along an edge or in a "
            "point at most, where nothing holds them together; let them overlap, or pass "
            "--components largest to keep the largest"
        )
    volumes = np.bincount(body, [part.volume for part in outer])
    largest = int(volumes.argmax())
    loose = [part for part, own in zip(outer, body) if own != largest]
    loose += [part for part in parts if part.volume < 0.0 and _lies_in(facets, part, loose)]
    dropped = np.zeros(len(facets), dtype=bool)
    dropped[np.concatenate([part.triangles for part in loose])] = True
    kept = surface.copy()
    kept.update_faces(~(dropped[facets.of_face] & (facets.of_face >= 0)))
    return kept


def _bodies(facets: Facets, parts: list[ClosedPart]) -> Index:
    """Body of each part: those that overlap, or share an area, are one."""
    pairs: list[tuple[int, int]] = []
    body = np.arange(len(parts))
    for i, j in combinations(range(len(parts)), 2):
        if body[i] != body[j] and joined(facets, parts[i], parts[j]):
            pairs.append((i, j))
            body = connected(len(parts), *np.array(pairs).T)
    return body


def _touch(facets: Facets, one: ClosedPart, other: ClosedPart) -> bool:
    """Whether a corner of one part lies on the other."""
    low, high = common_box(one, other)
    if (high - low < -TOUCHING).any():
        return False
    for own, others in ((one, other), (other, one)):
        corners = facets.vertices[np.unique(facets.triangles[own.triangles])]
        near = ((corners >= low - TOUCHING) & (corners <= high + TOUCHING)).all(axis=1)
        if (distances(facets, others, corners[near]) <= TOUCHING).any():
            return True
    return False


def _lies_in(facets: Facets, cavity: ClosedPart, parts: list[ClosedPart]) -> bool:
    corner = facets.vertices[facets.triangles[cavity.triangles[:1]]].mean(axis=1)
    numbers = [winding_numbers(facets, part.triangles, corner)[0] for part in parts]
    return any(abs(number) > 0.5 for number in numbers)
