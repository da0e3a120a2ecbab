"""Ray-traced frames of a scene: solids on tiles under the sun and the sky."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from sound.scenes.film.ground import SKYLIGHT, SUNLIGHT, Ground, sun_behind, unit
from sound.scenes.film.rays import Flags, Floats, PlacedSurface, RayedSurface, View, Window
from sound.scenes.performance import Appearance, Picture, linear_light

Bytes = NDArray[np.uint8]
Numbers = NDArray[np.intp]

GROUNDLIGHT = np.array([1.0, 0.96, 0.92], np.float32) * 0.20
"""Light from the ground on surfaces that face down."""
SHEEN = 0.14
"""Brightness of the highlights, added to the diffuse light."""
SHARPNESS = 40.0
"""Exponent of the highlights (Blinn and Phong)."""
EDGE_PLACES = np.array([[-0.375, -0.125], [0.125, -0.375], [0.375, 0.125], [-0.125, 0.375]])
"""Positions of the rays through a pixel at an edge [pixels from its centre]."""
EDGE_CONTRAST = 6
"""Least difference of green, of 255, between neighbouring pixels at an edge."""
LIFT = 0.004
"""Distance from the surface at which rays to the sun begin, over the solid's radius."""
TONES = 4096
"""Number of steps of brightness in the table of sRGB values."""
NOBODY = -1
"""Number that stands for no solid."""


class Stage:
    """A scene with camera, lights and colours, in frames of a width and height [pixels]."""

    def __init__(self, picture: Picture, size: tuple[int, int]) -> None:
        self.motion = picture.motion
        self.view = View(picture.camera, size)
        self.sun = sun_behind(self.view)
        height = -np.inf if picture.ground is None else picture.ground
        self.ground = Ground(height, self.view, self.sun)
        self.surfaces = [RayedSurface(each.vertices, each.faces) for each in picture.objects]
        self.colours = [_paint(each) for each in picture.objects]

    def frame(self, seconds: float) -> Bytes:
        """Frame (H, W, 3), sRGB, at a time."""
        moment = _Moment(self, self._placed(seconds))
        ground = self.ground.lit(moment.placed)
        light, owners = ground.copy(), np.full(self.view.shape, NOBODY)
        there = np.nonzero(moment.covered())
        light[there], owners[there] = moment.seen(_centres(there), ground[there])
        shown = _toned(light)
        edges = np.nonzero(_edges(owners, shown[..., 1]))
        places = (_centres(edges)[:, None] + EDGE_PLACES).reshape(-1, 2)
        softened, _ = moment.seen(places, ground[edges].repeat(len(EDGE_PLACES), axis=0))
        shown[edges] = _toned(softened.reshape(-1, len(EDGE_PLACES), 3).mean(axis=1))
        return shown

    def _placed(self, seconds: float) -> list[PlacedSurface]:
        positions, quaternions = self.motion.at(seconds)
        rotations = Rotation.from_quat(quaternions, scalar_first=True).as_matrix()
        return [
            PlacedSurface(surface, position.astype(np.float32), rotation.astype(np.float32))
            for surface, position, rotation in zip(self.surfaces, positions, rotations)
        ]


class _Moment:
    def __init__(self, stage: Stage, placed: Sequence[PlacedSurface]) -> None:
        self.stage, self.placed = stage, placed
        self.windows = [stage.view.window(each.points(each.surface.vertices)) for each in placed]

    def covered(self) -> Flags:
        """Pixels (H, W) that may show solids."""
        covered = np.zeros(self.stage.view.shape, bool)
        for window in self.windows:
            covered[window] = True
        return covered

    def seen(self, places: NDArray[np.floating], behind: Floats) -> tuple[Floats, Numbers]:
        """Light (n, 3) that comes from places (n, 2) [pixels], and numbers (n,) of the solids.

        Where there is no solid, it is the light `behind` (n, 3), and the number is `NOBODY`.
        """
        directions = self.stage.view.directions(places)
        owners, ways, normals, faces = self._met(places, directions)
        light = behind.copy()
        for number in range(len(self.placed)):
            own = np.flatnonzero(owners == number)
            points = self.stage.view.eye + ways[own, None] * directions[own]
            colours = self.stage.colours[number][faces[own]]
            light[own] = self._shaded(number, points, normals[own], directions[own], colours)
        return light, owners

    def _met(
        self, places: NDArray[np.floating], directions: Floats
    ) -> tuple[Numbers, Floats, Floats, Numbers]:
        """Numbers (n,) of the first solids on rays, ways (n,) to them, normals (n, 3) and triangles
        (n,) there.
        """
        ways = self.stage.ground.ways(directions)
        owners, normals = np.full(len(places), NOBODY), np.zeros_like(directions)
        faces = np.zeros(len(places), dtype=np.intp)
        for number, (solid, window) in enumerate(zip(self.placed, self.windows)):
            near = np.flatnonzero(_within(places, window))
            met = solid.meet(self.stage.view.eye, directions[near])
            nearer = met.ways < ways[near[met.rays]]
            first = near[met.rays[nearer]]
            owners[first], ways[first] = number, met.ways[nearer]
            normals[first], faces[first] = met.normals[nearer], met.faces[nearer]
        return owners, ways, normals, faces

    def _shaded(
        self, number: int, points: Floats, normals: Floats, directions: Floats, colours: Floats
    ) -> Floats:
        sun = self.stage.sun
        direct = np.maximum(normals @ sun, 0.0) * self._sunny(number, points, normals)
        upwards = 0.5 + 0.5 * normals[:, 2:]
        around = upwards * SKYLIGHT + (1.0 - upwards) * GROUNDLIGHT
        halfway = unit(sun - unit(directions))
        gleam = np.maximum(np.einsum("ij,ij->i", normals, halfway), 0.0) ** SHARPNESS
        gleam *= SHEEN * (direct > 0.0)
        diffuse = colours * (direct[:, None] * SUNLIGHT + around)
        return (diffuse + gleam[:, None] * SUNLIGHT).astype(np.float32)

    def _sunny(self, number: int, points: Floats, normals: Floats) -> Flags:
        sun, solid = self.stage.sun, self.placed[number]
        sunny = normals @ sun > 0.0
        for other in self.placed:
            if other.may_shade(solid, sun):
                left = np.flatnonzero(sunny)
                starts = points[left] + LIFT * solid.surface.radius * normals[left]
                sunny[left] = ~other.hides(starts, np.broadcast_to(sun, starts.shape))
        return sunny


def _paint(surface: Appearance) -> Floats:
    """Light (F, 3) of each triangle's colour."""
    if surface.painted is None:
        return np.tile(linear_light(surface.colour).astype(np.float32), (len(surface.faces), 1))
    return np.array([linear_light(each) for each in surface.colours], np.float32)[surface.painted]


def _centres(pixels: tuple[Numbers, ...]) -> NDArray[np.float64]:
    """Places (n, 2) of pixels by rows (n,) and columns (n,)."""
    rows, columns = pixels
    return np.stack([columns, rows], axis=1) + 0.5


def _within(places: NDArray[np.floating], window: Window) -> Flags:
    (x, y), (rows, columns) = places.T, window
    return (columns.start <= x) & (x < columns.stop) & (rows.start <= y) & (y < rows.stop)


def _edges(owners: Numbers, tones: Bytes) -> Flags:
    """Pixels (H, W) next to another solid or to a much different pixel."""
    edges = np.zeros(owners.shape, bool)
    for first, second in (
        (np.s_[:-1, :], np.s_[1:, :]),
        (np.s_[:, :-1], np.s_[:, 1:]),
    ):
        apart = np.abs(tones[first].astype(np.int16) - tones[second]) > EDGE_CONTRAST
        apart &= (owners[first] != NOBODY) | (owners[second] != NOBODY)
        apart |= owners[first] != owners[second]
        edges[first] |= apart
        edges[second] |= apart
    return edges


def _toned(light: Floats) -> Bytes:
    """sRGB values from 0 to 255 of light from 0 to 1 (IEC 61966-2-1)."""
    steps = np.arange(TONES) / (TONES - 1)
    curve = np.where(steps <= 0.0031308, 12.92 * steps, 1.055 * steps ** (1 / 2.4) - 0.055)
    table = np.rint(255.0 * curve).astype(np.uint8)
    return table[np.rint(np.clip(light, 0.0, 1.0) * (TONES - 1)).astype(np.uint16)]
