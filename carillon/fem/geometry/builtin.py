"""Struck objects made by code, in metres and z up, and a plain box to measure on.

Walls measure at least a sixteenth of the longest side: two voxels at resolution 32, since a wall of
one voxel does not bend as a wall does. Parts overlap without being united; voxels do that.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import trimesh

from carillon import builtin_names
from carillon.errors import UserError
from carillon.fem.geometry.sweep import SECTIONS, joined, spline, sweep, tube, turned
from carillon.fem.geometry.thin import THIN
from carillon.fem.geometry.trials import TRIALS
from carillon.parameters.mistyped import alike


def bar() -> trimesh.Trimesh:
    """Marimba bar, 240 x 45 x 30 mm, with the arch below its middle that tunes the overtones."""
    x = np.linspace(-0.120, 0.120, 49)
    arch = 0.015 * np.clip(1 - (x / 0.075) ** 2, 0, None)
    width, top = 0.045 / 2, 0.030
    low, high = np.full_like(x, -width), np.full_like(x, width)
    ceiling = np.full_like(x, top)
    corners = [(x, low, arch), (x, high, arch), (x, high, ceiling), (x, low, ceiling)]
    return sweep(np.stack([np.stack(corner, axis=1) for corner in corners], axis=1))


def box() -> trimesh.Trimesh:
    """Solid box, 200 x 150 x 100 mm: whole 2x2x2 blocks at every resolution that 8 divides."""
    return trimesh.creation.box(bounds=[(-0.100, -0.075, 0.0), (0.100, 0.075, 0.100)])


def bowl() -> trimesh.Trimesh:
    """Singing bowl, 160 mm wide and 84 mm high, wall 10 mm."""
    angle = np.linspace(0.0, np.pi / 2, 25)
    outside = np.stack([0.080 * np.sin(angle) ** 0.8, 0.084 * (1 - np.cos(angle))], axis=1)
    inside = np.stack([0.069 * np.sin(angle) ** 0.8, 0.012 + 0.072 * (1 - np.cos(angle))], axis=1)
    return turned([*outside, *inside[::-1]])


def bell() -> trimesh.Trimesh:
    """Church bell, 176 mm wide and 202 mm high, with a thick sound bow and a ring to hang it by."""
    outside = [
        (0.000, 0.168),
        (0.028, 0.167),
        (0.041, 0.160),
        (0.047, 0.148),
        (0.051, 0.120),
        (0.055, 0.090),
        (0.061, 0.060),
        (0.070, 0.034),
        (0.081, 0.013),
        (0.088, 0.000),
    ]
    inside = [
        (0.072, 0.000),
        (0.064, 0.014),
        (0.053, 0.036),
        (0.045, 0.062),
        (0.041, 0.090),
        (0.037, 0.120),
        (0.033, 0.141),
        (0.022, 0.150),
        (0.000, 0.152),
    ]
    turn = np.linspace(-np.pi / 6, np.pi + np.pi / 6, 33)
    ring = np.stack([0.021 * np.cos(turn), np.zeros_like(turn), 0.174 + 0.021 * np.sin(turn)], 1)
    return joined(turned([*outside, *inside]), tube(ring, 0.0075))


def frying_pan() -> trimesh.Trimesh:
    """Cast-iron frying pan, 240 mm wide, with a handle of 130 mm."""
    pan = [
        (0.000, 0.000),
        (0.095, 0.000),
        (0.103, 0.006),
        (0.120, 0.066),
        (0.097, 0.066),
        (0.086, 0.022),
        (0.000, 0.022),
    ]
    x = np.linspace(0.100, 0.245, 25)
    along = (x - x[0]) / (x[-1] - x[0])
    rise = 0.048 + 0.020 * along
    width = 0.013 + 0.006 * along
    # A rounded end, an eighth of the handle long.
    width = width * np.sqrt(np.clip(1 - np.clip((along - 0.87) / 0.14, 0, 1) ** 2, 0, None))
    centre = np.stack([x, np.zeros_like(x), rise], axis=1)
    return joined(turned(pan), tube(centre, width, flatten=0.0125))


def pitcher() -> trimesh.Trimesh:
    """Jug of 240 mm height, with a handle on one side and a lip on the other."""
    outside = [
        (0.000, 0.000),
        (0.052, 0.000),
        (0.064, 0.010),
        (0.079, 0.055),
        (0.080, 0.085),
        (0.072, 0.125),
        (0.057, 0.165),
        (0.053, 0.190),
        (0.060, 0.240),
    ]
    inside = [
        (0.044, 0.240),
        (0.037, 0.190),
        (0.041, 0.165),
        (0.056, 0.125),
        (0.064, 0.085),
        (0.063, 0.055),
        (0.050, 0.018),
        (0.000, 0.018),
    ]
    body = turned([*outside, *inside])
    _pull_lip(body, start=0.185, top=0.240, reach=0.034)
    handle = spline([(-0.052, 0.212), (-0.100, 0.222), (-0.126, 0.165), (-0.070, 0.085)])
    return joined(body, tube(handle, 0.0100))


def snare_drum() -> trimesh.Trimesh:
    """Snare drum of 14 inches as one solid: shell, two heads, hoops and eight lugs."""
    radius, height, wall = 0.178, 0.150, 0.025
    shell = turned(
        [(radius - wall, 0.0), (radius, 0.0), (radius, height), (radius - wall, height)], ring=True
    )
    parts = [shell]
    for z in (0.012, height - 0.012):
        head = trimesh.creation.cylinder(radius - wall / 2, height=0.024, sections=SECTIONS)
        parts.append(head.apply_translation((0.0, 0.0, z)))
        hoop = [(radius - wall, -0.017), (radius + 0.014, -0.017)]
        hoop += [(radius + 0.014, 0.017), (radius - wall, 0.017)]
        parts.append(turned(hoop, ring=True).apply_translation((0.0, 0.0, z)))
    for angle in np.arange(8) * np.pi / 4 + np.pi / 8:
        lug = trimesh.creation.box(extents=(0.034, 0.026, height))
        lug.apply_translation((radius, 0.0, height / 2))
        parts.append(lug.apply_transform(trimesh.transformations.rotation_matrix(angle, (0, 0, 1))))
    return joined(*parts)


def plate() -> trimesh.Trimesh:
    """Stoneware plate, 240 mm wide, 15 mm thick, with a raised rim."""
    return turned(
        [
            (0.000, 0.000),
            (0.072, 0.000),
            (0.088, 0.010),
            (0.120, 0.022),
            (0.120, 0.038),
            (0.084, 0.026),
            (0.068, 0.016),
            (0.000, 0.016),
        ]
    )


BUILTINS: dict[str, Callable[[], trimesh.Trimesh]] = builtin_names.named(
    builtin_names.THICK, bar, bell, bowl, box, frying_pan, pitcher, plate, snare_drum
)


def builtin_surface(name: str) -> trimesh.Trimesh:
    """Surface of the built-in object, thick or thin, or trial solid `name` in metres, closed.

    Raises
    ------
    UserError
        If there is no such object; the message lists the names.

    Examples
    --------
    >>> builtin_surface("bar").is_watertight
    True
    """
    known = {**BUILTINS, **THIN, **TRIALS}
    if name not in known:
        meant = alike(name, known)
        hint = f" (did you mean {meant}?)" if meant else ""
        raise UserError(
            f"builtin:{name}: no such built-in object{hint}, expected one of {', '.join(known)}"
        )
    return known[name]()


def _pull_lip(body: trimesh.Trimesh, start: float, top: float, reach: float) -> None:
    """Draw the rim of a turned body out towards +x, above the height `start`, by up to `reach`."""
    x, y, z = np.asarray(body.vertices).T
    rise = np.clip((z - start) / (top - start), 0, 1) ** 2
    facing = np.clip(x / np.maximum(np.hypot(x, y), 1e-9), 0, 1) ** 4
    body.vertices = np.stack([x + reach * rise * facing, y, z + 0.3 * reach * rise * facing], 1)
