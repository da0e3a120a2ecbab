"""Modes of a design for programs that synthesise them: frequencies, decays, amplitudes by point."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from carillon.arrays import Array
from sound.export.full_scale import gain_within
from sound.levels import DECAY_NEPERS
from sound.project.design import Design
from sound.rendering.listening import Listening
from sound.rendering.solid import SoundingSolid

LEAST_DAMPING = 1e-3
"""Least damping [1/s], since other programs need finite decay times."""


@dataclass(frozen=True)
class StruckPoint:
    """A named point of the surface: `position` (3,) [m] and unit vector `inward` (3,)."""

    name: str
    position: Array
    inward: Array


@dataclass(frozen=True)
class ModalModel:
    """The N elastic modes of a design, and what they sound with when one of its points is struck.

    An impulse f [N s] along the inward normal of point p sounds as f sum_k a_pk exp(-d_k t)
    sin(2 pi f_k t).  `amplitudes` a (p, N) are in samples of full scale per N s: 1 N s sounds as
    loud as the clip of a target.  `frequencies` f (N,) are in Hz, `dampings` d (N,) in 1/s.
    """

    name: str
    points: tuple[StruckPoint, ...]
    frequencies: Array
    dampings: Array
    amplitudes: Array

    @classmethod
    def of_design(cls, design: Design, points: int = 0, name: str | None = None) -> ModalModel:
        """The modes of a design at the targets' points and so many others all over the surface.

        Its name is by default that of the solid.
        """
        solid = SoundingSolid.of_design(design)
        listening = Listening.of_design(design, solid)
        struck = struck_points(design, points)
        positions = np.array([point.position for point in struck])
        inward = np.array([point.inward for point in struck])
        gains = np.array([[listening.gain(position)] for position in positions])
        return cls(
            name or design.name,
            struck,
            solid.frequencies,
            np.maximum(solid.dampings, LEAST_DAMPING),
            gains * solid.amplitudes(positions, inward),
        )

    @cached_property
    def gain(self) -> float:
        """Factor, 1 at most, that keeps 1 N s at the loudest point within full scale."""
        return gain_within(self.frequencies, self.dampings, self.amplitudes)

    @property
    def decay_times(self) -> Array:
        """T60 (N,) [s]: times in which the modes decay by 60 dB."""
        return np.asarray(DECAY_NEPERS / self.dampings)


def struck_points(design: Design, points: int = 0) -> tuple[StruckPoint, ...]:
    """The targets' points, and so many others, each the farthest from all before.

    Fewer others are there if the surface has fewer vertices.
    """
    import trimesh

    from solver.response.vertices import inward_normals, spread

    struck = [StruckPoint(each.name, each.position, each.inward) for each in design.strikes]
    if points:
        used = np.unique(design.surface_faces)
        taken = np.array([each.position for each in struck])
        chosen = used[spread(design.surface_vertices[used], taken, points)]
        others = design.surface_vertices[chosen]
        surface = trimesh.Trimesh(design.surface_vertices, design.surface_faces, process=False)
        normals = inward_normals(surface, others)
        names = [f"vertex_{vertex}" for vertex in chosen]
        struck += map(StruckPoint, names, others, normals)
    return tuple(struck)
