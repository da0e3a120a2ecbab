"""Struck objects with walls as thin as real ones, made by code, in metres and z up.

Walls measure a hundredth of the object or less, far below a voxel: they are for finite cells.
Voxels make something else of them, or refuse.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import trimesh

from carillon import builtin_names
from carillon.fem.geometry.sweep import joined, turned


def skillet() -> trimesh.Trimesh:
    """Pan of sheet iron, 260 mm wide and 50 mm high, all walls 4 mm, with a flat handle."""
    pan = turned(
        [
            (0.0000, 0.0000),
            (0.1000, 0.0000),
            (0.1300, 0.0500),
            (0.1253, 0.0500),
            (0.0977, 0.0040),
            (0.0000, 0.0040),
        ]
    )
    # It begins inside the wall.
    handle = trimesh.creation.box(bounds=[(0.1235, -0.0120, 0.0400), (0.3000, 0.0120, 0.0460)])
    return joined(pan, handle)


def handbell() -> trimesh.Trimesh:
    """Bell of 104 mm mouth and 100 mm height, wall 3 mm."""
    outside = [
        (0.000, 0.100),
        (0.018, 0.100),
        (0.030, 0.092),
        (0.034, 0.070),
        (0.038, 0.040),
        (0.046, 0.012),
        (0.052, 0.000),
    ]
    inside = [
        (0.0488, 0.0000),
        (0.0430, 0.0120),
        (0.0350, 0.0405),
        (0.0310, 0.0700),
        (0.0275, 0.0900),
        (0.0170, 0.0970),
        (0.0000, 0.0970),
    ]
    return turned([*outside, *inside])


def rin() -> trimesh.Trimesh:
    """Singing bowl of a temple, 120 mm wide and 70 mm high, wall 2.5 mm."""
    angle = np.linspace(0.0, np.pi / 2, 25)
    across, up = np.sin(angle) ** 0.8, 1 - np.cos(angle)
    outside = np.stack([0.0600 * across, 0.0700 * up], axis=1)
    inside = np.stack([0.0575 * across, 0.0025 + 0.0675 * up], axis=1)
    return turned([*outside, *inside[::-1]])


def wine_glass() -> trimesh.Trimesh:
    """Wine glass of 205 mm height, its bowl 82 mm wide with a wall of 1.2 mm."""
    outside = [
        (0.0000, 0.0000),
        (0.0350, 0.0000),
        (0.0350, 0.0020),
        (0.0060, 0.0060),
        (0.0040, 0.0120),
        (0.0040, 0.0900),
        (0.0120, 0.0980),
        (0.0300, 0.1120),
        (0.0400, 0.1350),
        (0.0410, 0.1550),
        (0.0360, 0.1800),
        (0.0310, 0.2050),
    ]
    inside = [
        (0.0298, 0.2050),
        (0.0348, 0.1800),
        (0.0398, 0.1550),
        (0.0388, 0.1354),
        (0.0292, 0.1130),
        (0.0115, 0.0994),
        (0.0000, 0.0985),
    ]
    return turned([*outside, *inside])


def cymbal() -> trimesh.Trimesh:
    """Cymbal of 360 mm, 1.2 mm thick, with a cup and a hole of 12 mm in its middle."""
    radius = np.concatenate([np.linspace(0.006, 0.060, 19), np.linspace(0.066, 0.180, 20)])
    cup = 0.020 * np.cos(np.pi / 2 * np.minimum(radius / 0.055, 1.0)) ** 2
    height = 0.028 * (1.0 - (radius / 0.180) ** 2) + cup
    above = np.stack([radius, height + 0.0012], axis=1)
    below = np.stack([radius, height], axis=1)
    return turned([*below, *above[::-1]], ring=True)


THIN: dict[str, Callable[[], trimesh.Trimesh]] = builtin_names.named(
    builtin_names.THIN, cymbal, handbell, rin, skillet, wine_glass
)
