"""Solids made by code, in metres and z up; parts overlap without being united.

Struck objects for voxels have walls of a sixteenth of the longest side at least: two voxels at
resolution 32, since a wall of one voxel does not bend as a wall does. Thin ones, with walls as real
objects have them, a hundredth of the object or less, are for finite cells: voxels make something
else of them, or refuse. Trial solids have joints and gaps of about a twenty-fourth of the longest
side, one voxel at resolution 24; they took no part in any choice of constants.
"""

from collections.abc import Callable, Sequence

import numpy as np
import trimesh
from trimesh.creation import box as cuboid
from trimesh.creation import cylinder, icosphere
from trimesh.transformations import rotation_matrix

from carillon import builtin_names
from carillon.errors import UserError
from carillon.fem.geometry.sweep import SECTIONS, joined, spline, sweep, tube, turned
from carillon.parameters.sentences import did_you_mean

SIDE = 0.24
"""Longest side of most trial solids [m]."""
VOXEL = SIDE / 24


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
    return cuboid(bounds=[(-0.100, -0.075, 0.0), (0.100, 0.075, 0.100)])


def bowl() -> trimesh.Trimesh:
    """Singing bowl, 160 mm wide and 84 mm high, wall 10 mm."""
    angle = np.linspace(0.0, np.pi / 2, 25)
    across, up = np.sin(angle) ** 0.8, 1 - np.cos(angle)
    return turned(
        [*0.080 * across, *(0.069 * across)[::-1]], [*0.084 * up, *(0.012 + 0.072 * up)[::-1]]
    )


def bell() -> trimesh.Trimesh:
    """Church bell, 176 mm wide and 202 mm high, with a thick sound bow and a ring to hang it by."""
    radius = [0.000, 0.028, 0.041, 0.047, 0.051, 0.055, 0.061, 0.070, 0.081, 0.088]
    height = [0.168, 0.167, 0.160, 0.148, 0.120, 0.090, 0.060, 0.034, 0.013, 0.000]
    radius += [0.072, 0.064, 0.053, 0.045, 0.041, 0.037, 0.033, 0.022, 0.000]
    height += [0.000, 0.014, 0.036, 0.062, 0.090, 0.120, 0.141, 0.150, 0.152]
    turn = np.linspace(-np.pi / 6, np.pi + np.pi / 6, 33)
    ring = np.stack([0.021 * np.cos(turn), np.zeros_like(turn), 0.174 + 0.021 * np.sin(turn)], 1)
    return joined(turned(radius, height), tube(ring, 0.0075))


def frying_pan() -> trimesh.Trimesh:
    """Cast-iron frying pan, 240 mm wide, with a handle of 130 mm."""
    radius = [0.000, 0.095, 0.103, 0.120, 0.097, 0.086, 0.000]
    height = [0.000, 0.000, 0.006, 0.066, 0.066, 0.022, 0.022]
    x = np.linspace(0.100, 0.245, 25)
    along = (x - x[0]) / (x[-1] - x[0])
    rise = 0.048 + 0.020 * along
    width = 0.013 + 0.006 * along
    # A rounded end, an eighth of the handle long.
    width = width * np.sqrt(np.clip(1 - np.clip((along - 0.87) / 0.14, 0, 1) ** 2, 0, None))
    centre = np.stack([x, np.zeros_like(x), rise], axis=1)
    return joined(turned(radius, height), tube(centre, width, flatten=0.0125))


def pitcher() -> trimesh.Trimesh:
    """Jug of 240 mm height, with a handle on one side and a lip on the other."""
    radius = [0.000, 0.052, 0.064, 0.079, 0.080, 0.072, 0.057, 0.053, 0.060]
    height = [0.000, 0.000, 0.010, 0.055, 0.085, 0.125, 0.165, 0.190, 0.240]
    radius += [0.044, 0.037, 0.041, 0.056, 0.064, 0.063, 0.050, 0.000]
    height += [0.240, 0.190, 0.165, 0.125, 0.085, 0.055, 0.018, 0.018]
    body = turned(radius, height)
    _pull_lip(body, start=0.185, top=0.240, reach=0.034)
    handle = spline([(-0.052, 0.212), (-0.100, 0.222), (-0.126, 0.165), (-0.070, 0.085)])
    return joined(body, tube(handle, 0.0100))


def snare_drum() -> trimesh.Trimesh:
    """Snare drum of 14 inches as one solid: shell, two heads, hoops and eight lugs."""
    radius, height, wall = 0.178, 0.150, 0.025
    across = [radius - wall, radius, radius, radius - wall]
    parts = [turned(across, [0.0, 0.0, height, height], ring=True)]
    across = [radius - wall, radius + 0.014, radius + 0.014, radius - wall]
    for z in (0.012, height - 0.012):
        head = cylinder(radius - wall / 2, height=0.024, sections=SECTIONS)
        parts.append(head.apply_translation((0.0, 0.0, z)))
        hoop = turned(across, [-0.017, -0.017, 0.017, 0.017], ring=True)
        parts.append(hoop.apply_translation((0.0, 0.0, z)))
    for angle in np.arange(8) * np.pi / 4 + np.pi / 8:
        lug = cuboid(extents=(0.034, 0.026, height))
        lug.apply_translation((radius, 0.0, height / 2))
        parts.append(lug.apply_transform(rotation_matrix(angle, (0, 0, 1))))
    return joined(*parts)


def plate() -> trimesh.Trimesh:
    """Stoneware plate, 240 mm wide, 15 mm thick, with a raised rim."""
    radius = [0.000, 0.072, 0.088, 0.120, 0.120, 0.084, 0.068, 0.000]
    height = [0.000, 0.000, 0.010, 0.022, 0.038, 0.026, 0.016, 0.016]
    return turned(radius, height)


def skillet() -> trimesh.Trimesh:
    """Pan of sheet iron, 260 mm wide and 50 mm high, all walls 4 mm, with a flat handle."""
    radius = [0.0000, 0.1000, 0.1300, 0.1253, 0.0977, 0.0000]
    height = [0.0000, 0.0000, 0.0500, 0.0500, 0.0040, 0.0040]
    # It begins inside the wall.
    handle = cuboid(bounds=[(0.1235, -0.0120, 0.0400), (0.3000, 0.0120, 0.0460)])
    return joined(turned(radius, height), handle)


def handbell() -> trimesh.Trimesh:
    """Bell of 104 mm mouth and 100 mm height, wall 3 mm."""
    radius = [0.000, 0.018, 0.030, 0.034, 0.038, 0.046, 0.052]
    height = [0.100, 0.100, 0.092, 0.070, 0.040, 0.012, 0.000]
    radius += [0.0488, 0.0430, 0.0350, 0.0310, 0.0275, 0.0170, 0.0000]
    height += [0.0000, 0.0120, 0.0405, 0.0700, 0.0900, 0.0970, 0.0970]
    return turned(radius, height)


def rin() -> trimesh.Trimesh:
    """Singing bowl of a temple, 120 mm wide and 70 mm high, wall 2.5 mm."""
    angle = np.linspace(0.0, np.pi / 2, 25)
    across, up = np.sin(angle) ** 0.8, 1 - np.cos(angle)
    return turned(
        [*0.0600 * across, *(0.0575 * across)[::-1]], [*0.0700 * up, *(0.0025 + 0.0675 * up)[::-1]]
    )


def wine_glass() -> trimesh.Trimesh:
    """Wine glass of 205 mm height, its bowl 82 mm wide with a wall of 1.2 mm."""
    radius = [0.0000, 0.0350, 0.0350, 0.0060, 0.0040, 0.0040, 0.0120, 0.0300, 0.0400, 0.0410]
    height = [0.0000, 0.0000, 0.0020, 0.0060, 0.0120, 0.0900, 0.0980, 0.1120, 0.1350, 0.1550]
    radius += [0.0360, 0.0310, 0.0298, 0.0348, 0.0398, 0.0388, 0.0292, 0.0115, 0.0000]
    height += [0.1800, 0.2050, 0.2050, 0.1800, 0.1550, 0.1354, 0.1130, 0.0994, 0.0985]
    return turned(radius, height)


def cymbal() -> trimesh.Trimesh:
    """Cymbal of 360 mm, 1.2 mm thick, with a cup and a hole of 12 mm in its middle."""
    radius = np.concatenate([np.linspace(0.006, 0.060, 19), np.linspace(0.066, 0.180, 20)])
    cup = 0.020 * np.cos(np.pi / 2 * np.minimum(radius / 0.055, 1.0)) ** 2
    height = 0.028 * (1.0 - (radius / 0.180) ** 2) + cup
    return turned([*radius, *radius[::-1]], [*height, *(height + 0.0012)[::-1]], ring=True)


def comb() -> trimesh.Trimesh:
    """Back with six teeth of two voxels, one voxel apart."""
    teeth = [
        _block((x, 0.0, 0.05), (x + 2 * VOXEL, 3 * VOXEL, SIDE)) for x in 3 * VOXEL * np.arange(6)
    ]
    return joined(_block((0.0, 0.0, 0.0), (17 * VOXEL, 3 * VOXEL, 0.05)), *teeth)


def cup() -> trimesh.Trimesh:
    """Cup whose handle is fixed above and nearly touches the wall below."""
    radius = [0.000, 0.070, 0.075, 0.075, 0.055, 0.055, 0.000]
    height = [0.000, 0.000, 0.020, 0.170, 0.170, 0.022, 0.022]
    wall = turned(radius, height)
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
        parts.append(tube(path, 0.024, flatten=0.0105))
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


def _block(low: Sequence[float], high: Sequence[float]) -> trimesh.Trimesh:
    return cuboid(bounds=[low, high])


def _pull_lip(body: trimesh.Trimesh, start: float, top: float, reach: float) -> None:
    """Draw the rim of a turned body out towards +x, above the height `start`, by up to `reach`."""
    x, y, z = np.asarray(body.vertices).T
    rise = np.clip((z - start) / (top - start), 0, 1) ** 2
    facing = np.clip(x / np.maximum(np.hypot(x, y), 1e-9), 0, 1) ** 4
    body.vertices = np.stack([x + reach * rise * facing, y, z + 0.3 * reach * rise * facing], 1)


Makers = dict[str, Callable[[], trimesh.Trimesh]]


def _named(names: Sequence[str], *makers: Callable[[], trimesh.Trimesh]) -> Makers:
    by_name = {make.__name__.replace("_", "-"): make for make in makers}
    assert list(by_name) == list(names)
    return by_name


BUILTINS = _named(builtin_names.THICK, bar, bell, bowl, box, frying_pan, pitcher, plate, snare_drum)
THIN = _named(builtin_names.THIN, cymbal, handbell, rin, skillet, wine_glass)
TRIALS = _named(
    builtin_names.TRIALS, comb, cup, dumbbell, eared_head, fork, slit_ring, spiral, stool
)


def builtin_surface(name: str) -> trimesh.Trimesh:
    """Surface of the built-in object, thick or thin, or trial solid `name` in metres, closed.

    Raises UserError if there is no such object; the message lists the names.

    Examples
    --------
    >>> builtin_surface("bar").is_watertight
    True
    """
    known = {**BUILTINS, **THIN, **TRIALS}
    if name not in known:
        hint = did_you_mean(name, known)
        raise UserError(
            f"builtin:{name}: no such built-in object{hint}, expected one of {', '.join(known)}"
        )
    return known[name]()
