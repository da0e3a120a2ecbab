"""Solids with thin joints and narrow gaps, made by code, that coarsenings are tried on.

They took no part in any choice of constants: `solver calibrate` leaves them out. Lengths are in
metres; gaps and walls measure about a twenty-fourth of the longest side, one voxel at resolution
24. Parts overlap without being united, as in `carillon.fem.geometry.builtin`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import trimesh
from trimesh.creation import box, cylinder, icosphere
from trimesh.transformations import rotation_matrix

from carillon import builtin_names
from carillon.fem.geometry.sweep import joined, sweep, tube, turned

SIDE = 0.24
"""Longest side of most of them [m]; a voxel at resolution 24 measures a hundredth of a metre."""

VOXEL = SIDE / 24


def comb() -> trimesh.Trimesh:
    """Back with six teeth of two voxels, one voxel apart."""
    teeth = [
        _block((x, 0.0, 0.05), (x + 2 * VOXEL, 3 * VOXEL, SIDE)) for x in 3 * VOXEL * np.arange(6)
    ]
    return joined(_block((0.0, 0.0, 0.0), (17 * VOXEL, 3 * VOXEL, 0.05)), *teeth)


def cup() -> trimesh.Trimesh:
    """Cup whose handle is fixed above and nearly touches the wall below."""
    wall = turned(
        [
            (0.000, 0.000),
            (0.070, 0.000),
            (0.075, 0.020),
            (0.075, 0.170),
            (0.055, 0.170),
            (0.055, 0.022),
            (0.000, 0.022),
        ]
    )
    turn = np.linspace(0.62 * np.pi, -0.42 * np.pi, 33)
    x, z = 0.072 + 0.055 * np.cos(turn), 0.090 + 0.055 * np.sin(turn)
    path = np.stack([x, np.zeros_like(x), z], axis=1)
    path[-6:, 0] = np.maximum(path[-6:, 0], 0.0975)
    return joined(wall, tube(path, 0.0115))


def dumbbell() -> trimesh.Trimesh:
    """Two spheres joined by a neck of two voxels."""
    spheres = [icosphere(4, 0.050).apply_translation((x, 0.0, 0.0)) for x in (-0.070, 0.070)]
    neck = cylinder(0.0105, height=0.1, sections=48)
    return joined(*spheres, neck.apply_transform(rotation_matrix(np.pi / 2, (0, 1, 0))))


def eared_head() -> trimesh.Trimesh:
    """Head with two long ears that lie along it, a voxel away."""
    parts = [icosphere(4, 0.062)]
    for side in (-1.0, 1.0):
        angle = np.linspace(0.10, 0.75, 33) * np.pi
        reach = np.minimum(0.055 + 0.25 * (angle - angle[0]), 0.0855)
        path = np.stack([side * reach * np.sin(angle), 0.0 * angle, reach * np.cos(angle)], axis=1)
        ear = tube(path, 0.024, flatten=0.0105)
        parts.append(ear)
    return joined(*parts)


def fork() -> trimesh.Trimesh:
    """Tuning fork: two tines of three voxels, two voxels apart, on a thin stem."""
    tines = [_block((x, 0.0, 0.07), (x + 0.03, 0.03, SIDE)) for x in (0.0, 0.05)]
    yoke = _block((0.0, 0.0, 0.05), (0.08, 0.03, 0.08))
    return joined(*tines, yoke, _block((0.03, 0.005, 0.0), (0.05, 0.025, 0.06)))


def slit_ring() -> trimesh.Trimesh:
    """Ring of square section, cut through by a slit of one voxel."""
    turn = np.linspace(0.04 * np.pi, 1.96 * np.pi, 97)
    centre = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    corners = [(0.085, -0.02), (0.120, -0.02), (0.120, 0.02), (0.085, 0.02)]
    sections = [np.column_stack([r * centre, np.full(len(turn), z)]) for r, z in corners]
    return sweep(np.stack(sections, axis=1))


def spiral() -> trimesh.Trimesh:
    """Strip of two voxels, rolled up with gaps of one to two."""
    turn = np.linspace(0.0, 4.4 * np.pi, 161)
    inner = 0.018 + 0.034 * turn / (2 * np.pi)
    edges = [(0.0, -0.03), (0.02, -0.03), (0.02, 0.03), (0.0, 0.03)]
    direction = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    sections = [
        np.column_stack([(inner + out)[:, None] * direction, np.full(len(turn), z)])
        for out, z in edges
    ]
    return sweep(np.stack(sections, axis=1))


def stool() -> trimesh.Trimesh:
    """Round seat on three slanted legs of two voxels."""
    parts = [cylinder(0.09, height=0.025, sections=96).apply_translation((0.0, 0.0, 0.2275))]
    for angle in np.arange(3) * 2 * np.pi / 3 + 0.3:
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        parts.append(
            cylinder(0.011, segment=np.array([0.05 * out + [0, 0, 0.225], 0.10 * out]), sections=32)
        )
    return joined(*parts)


TRIALS: dict[str, Callable[[], trimesh.Trimesh]] = builtin_names.named(
    builtin_names.TRIALS, comb, cup, dumbbell, eared_head, fork, slit_ring, spiral, stool
)


def _block(low: Sequence[float], high: Sequence[float]) -> trimesh.Trimesh:
    return box(bounds=[low, high])
