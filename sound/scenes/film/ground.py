"""Tiled ground of a film under sun and sky, with the shadows of solids."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from sound.scenes.film.rays import Flags, Floats, PlacedSurface, View, Window

SUN_AZIMUTH_DEGREES = 68.0
"""Azimuth of the sun, to the left from behind the camera."""
SUN_ELEVATION_DEGREES = 52.0
"""Elevation of the sun above the horizon."""
SUN_RADIUS_DEGREES = 2.5
"""Angular radius of the sun, which softens shadows with their distance."""
SKY_RADIUS_DEGREES = 65.0
"""Angle from the zenith within which solids shade the ground from the sky."""
SUNLIGHT = np.array([1.0, 0.96, 0.90], np.float32) * 0.80
"""Light that a white surface facing the sun reflects of it."""
SKYLIGHT = np.array([0.84, 0.91, 1.0], np.float32) * 0.36
"""Light that a white surface facing up reflects of the sky."""
TILES = np.array([[0.82, 0.82, 0.81], [0.72, 0.72, 0.71]], np.float32)
"""Reflectances of the two kinds of tiles on the ground."""
TILES_AHEAD = 9.0
"""Approximate number of tiles between the camera and its target."""
HORIZON = np.array([0.80, 0.84, 0.88], np.float32)
"""Light of the sky at the horizon."""
ABOVE_HORIZON = np.array([-0.38, -0.30, -0.18], np.float32)
"""Light of the sky at the zenith minus that at the horizon."""
FADING = 4.0
"""Distance at which the ground fades into the horizon, over that of the camera's target."""
SUN_SIDE, SKY_SIDE = 4, 6
"""Sides of the squares of pixels that together sample a light, a direction in each pixel."""
GROUND_SIDE = 4
"""Number of rays along each side of a pixel of the ground without shadows."""
UP = np.array([0.0, 0.0, 1.0], np.float32)
"""Unit vector upwards."""
GOLDEN_ANGLE = np.pi * (3.0 - 5.0**0.5)


class Light:
    """A light that falls on the ground from `directions` (s * s, 3), unit vectors of equal weight
    towards it.

    Each pixel of a square samples another direction, and the mean over the pixels around it is
    smooth, for one ray a pixel (interleaved sampling, Keller and Heidrich 2001).  Sampled pixels
    are `step` apart; unshaded white ground reflects `colour` (3,).
    """

    def __init__(self, colour: Floats, directions: Floats, step: int) -> None:
        self.colour, self.directions, self.step = colour, directions, step
        self.side = round(len(directions) ** 0.5)

    def kept_off(self, placed: Sequence[PlacedSurface], ground: Ground) -> tuple[Window, Floats]:
        """Window of the picture with shadows, and shaded share (h, w) of the light in it."""
        looking = np.s_[:: self.step, :: self.step]
        points, seen = ground.points[looking], ground.seen[looking]
        dark = np.zeros(seen.shape, bool)
        for solid in placed:
            rows, columns = (self._thinned(each) for each in self._window(solid, ground))
            down, right = np.nonzero(seen[rows, columns] & ~dark[rows, columns])
            down, right = down + rows.start, right + columns.start
            looked = self.directions[down % self.side * self.side + right % self.side]
            dark[down, right] = solid.hides(points[down, right], looked)
        return self._smooth(dark, ground.seen.shape)

    def _thinned(self, span: slice) -> slice:
        return slice(-(-span.start // self.step), -(-span.stop // self.step))

    def _smooth(self, dark: Flags, shape: tuple[int, ...]) -> tuple[Window, Floats]:
        rows, columns = _bounds(dark, margin=self.side)
        share = uniform_filter(dark[rows, columns].astype(np.float32), self.side)
        share = uniform_filter(share, self.side).repeat(self.step, axis=0)
        share = uniform_filter(share.repeat(self.step, axis=1), self.step)
        window = _scaled(rows, self.step, shape[0]), _scaled(columns, self.step, shape[1])
        height, width = (each.stop - each.start for each in window)
        return window, share[:height, :width]

    def _window(self, solid: PlacedSurface, ground: Ground) -> Window:
        corners = solid.points(solid.surface.corners)[:, None]
        ways = (corners[..., 2] - ground.height) / self.directions[:, 2]
        return ground.view.window((corners - ways[..., None] * self.directions).reshape(-1, 3))


class Ground:
    """Tiled ground at a height [m], minus infinity for none, and sky in the picture.

    `seen` (H, W) tells where the ground is visible, and `points` (H, W, 3) [m] are its points
    there; `reflectance` (H, W, 3) fades towards the horizon, `bright` (H, W, 3) is the picture
    without shadows.
    """

    def __init__(self, height: float, view: View, sun: Floats) -> None:
        self.height, self.view = height, view
        self.lights = (
            Light(SUNLIGHT * sun[2], _around(sun, SUN_SIDE**2, SUN_RADIUS_DEGREES), step=1),
            Light(SKYLIGHT, _around(UP, SKY_SIDE**2, SKY_RADIUS_DEGREES), step=2),
        )
        self.tile = _round_length(view.distance / TILES_AHEAD)
        directions = view.directions(view.centres())
        ways, lengths = self.ways(directions), np.linalg.norm(directions, axis=1)
        near = np.exp(-((ways * lengths / (FADING * view.distance)) ** 2))[:, None]
        behind = HORIZON + np.clip(directions[:, 2:] / lengths[:, None], 0.0, 1.0) * ABOVE_HORIZON
        tiles = TILES[0] + self._second_tiles()[:, None] * (TILES[1] - TILES[0])
        shape = (*view.shape, 3)
        self.seen = np.isfinite(ways).reshape(view.shape)
        self.points = self._ends(directions, ways).reshape(shape)
        self.reflectance = (near * tiles).reshape(shape)
        self.bright = ((1.0 - near) * behind).reshape(shape)
        self.bright += self.reflectance * sum(light.colour for light in self.lights)

    def ways(self, directions: Floats) -> Floats:
        """Ways (n,) of rays (n, 3) from the eye to the ground; infinite if they miss it."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ways = (self.height - self.view.eye[2]) / directions[:, 2]
        return np.where(ways > 0.0, ways, np.inf).astype(np.float32)

    def lit(self, placed: Sequence[PlacedSurface]) -> Floats:
        """Picture (H, W, 3) of the ground with shadows, without the solids."""
        picture = self.bright.copy()
        for light in self.lights if self.seen.any() else ():
            window, share = light.kept_off(placed, self)
            picture[window] -= self.reflectance[window] * (light.colour * share[..., None])
        return picture

    def _second_tiles(self) -> Floats:
        """Share (H * W,) of the second kind of tiles in each pixel."""
        centres = self.view.centres()
        share = np.zeros(len(centres), np.float32)
        offsets = (np.arange(GROUND_SIDE, dtype=np.float32) + 0.5) / GROUND_SIDE - 0.5
        for offset in np.stack(np.meshgrid(offsets, offsets), axis=-1).reshape(-1, 2):
            directions = self.view.directions(centres + offset)
            x, y = self._ends(directions, self.ways(directions))[:, :2].T / self.tile
            share += (np.floor(x) + np.floor(y)) % 2.0
        return share / GROUND_SIDE**2

    def _ends(self, directions: Floats, ways: Floats) -> Floats:
        """End points (n, 3) of rays from the eye; the eye itself for endless ones."""
        reach = np.where(np.isfinite(ways), ways, np.float32(0.0))
        return self.view.eye + reach[:, None] * directions


def sun_behind(view: View) -> Floats:
    """Unit vector (3,) to the sun, behind the camera."""
    right = view.axes[0]
    back = np.cross(right, UP)
    azimuth, elevation = np.radians([SUN_AZIMUTH_DEGREES, SUN_ELEVATION_DEGREES])
    level = np.cos(azimuth) * back - np.sin(azimuth) * right
    return (np.cos(elevation) * level + np.sin(elevation) * UP).astype(np.float32)


def _around(axis: Floats, count: int, degrees: float) -> Floats:
    """Unit vectors (count, 3) within an angle around an axis, evenly spread in its projection.

    They lie on a spiral of equal areas (Vogel 1979), so a matt surface across the axis receives the
    same light from each.
    """
    numbers = np.arange(count)
    radii = np.sin(np.radians(degrees)) * np.sqrt((numbers + 0.5) / count)
    turns = GOLDEN_ANGLE * numbers
    aside = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    first = unit(np.cross(axis, np.eye(3)[np.abs(axis).argmin()]))
    across = radii[:, None] * aside @ np.stack([first, np.cross(axis, first)])
    return (across + np.sqrt(1.0 - radii**2)[:, None] * axis).astype(np.float32)


def _round_length(length: float) -> float:
    """The greatest length of the form 1, 2 or 5 times a power of ten that is not above another.

    Examples
    --------
    >>> _round_length(0.34)
    0.2
    """
    power = 10.0 ** np.floor(np.log10(length))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step * power <= length))


def _bounds(flags: Flags, margin: int) -> Window:
    """The window around all set pixels, enlarged by a margin; empty if none is set."""
    rows, columns = (np.flatnonzero(flags.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return slice(0, 0), slice(0, 0)
    first, last = (
        slice(max(0, int(each[0]) - margin), int(each[-1]) + margin + 1) for each in (rows, columns)
    )
    return first, last


def _scaled(span: slice, step: int, count: int) -> slice:
    """Span of pixels, of `count`, for a span of sampled pixels."""
    return slice(min(span.start * step, count), min(span.stop * step, count))


def unit(vectors: NDArray[np.floating]) -> NDArray[np.floating]:
    """Vectors (..., 3) at length one."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
