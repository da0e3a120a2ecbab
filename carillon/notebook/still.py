"""A still picture of a solid: what is seen where no program runs, and before it does."""

import struct
import zlib

import numpy as np

from carillon.arrays import Array
from carillon.notebook.triangles import DRAWN_AMPLITUDE, Triangles

WIDTH, HEIGHT = 320, 240
"""Size of the picture [px]."""
FINER = 2
"""Pixels that are computed for each that is kept, along a side."""
ELEVATION, AZIMUTH = 22.0, -58.0
"""Angles [degrees] at which the eye stands at first."""
DISTANCE = 4.0
"""Distance of the eye from the middle of the solid [radii]."""
ZOOM = 0.92
"""Half of the picture's height over the radius."""
PLAIN = (230, 204, 163)
"""Colour of a solid without values."""
COLOURS = (
    (68, 1, 84),
    (65, 68, 135),
    (42, 120, 142),
    (34, 168, 132),
    (122, 209, 81),
    (253, 231, 37),
)
"""Colours of values from 0 to 1 (viridis)."""
KEY, FILL = (-0.45, 0.62, 0.64), (0.75, 0.2, 0.63)
"""Directions that light comes from, seen from the eye: right, up, towards it."""


def still_png(shown: Triangles) -> bytes:
    """Content of a PNG file with the triangles, in the first of their motions."""
    places, values = shown.places, shown.values
    if shown.motions:
        places = places + shown.motions[0]
        values = np.linalg.norm(shown.motions[0], axis=1) / DRAWN_AMPLITUDE
    seen = places @ view(ELEVATION, AZIMUTH).T
    corners = seen[shown.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    normals *= np.where(normals[:, 2:] < 0.0, -1.0, 1.0)
    faces = None if values is None else values[shown.faces].mean(axis=1)
    colours = _colours(faces, len(corners)) * _light(normals)[:, None]
    picture = _rasterised(corners, np.clip(colours, 0.0, 255.0))
    return _png(picture)


def view(elevation: float, azimuth: float) -> Array:
    """Rotation (3, 3) to axes right, up and towards an eye at some elevation and azimuth
    [degrees]."""
    e, a = np.radians([elevation, azimuth])
    return np.array(
        [
            [-np.sin(a), np.cos(a), 0.0],
            [-np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), np.cos(e)],
            [np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)],
        ]
    )


def _light(normals: Array) -> Array:
    """Brightness (t,) of triangles with unit normals (t, 3)."""
    lit = [np.clip(normals @ np.array(each), 0.0, 1.0) for each in (KEY, FILL)]
    return np.asarray(0.42 + 0.55 * lit[0] + 0.15 * lit[1])


def _colours(values: Array | None, count: int) -> Array:
    if values is None:
        return np.tile(np.array(PLAIN, dtype=float), (count, 1))
    stops = np.linspace(0.0, 1.0, len(COLOURS))
    return np.stack([np.interp(values, stops, channel) for channel in np.array(COLOURS).T], axis=1)


def _rasterised(corners: Array, colours: Array) -> Array:
    """Pixels (h, w, 4) uint8 of triangles (t, 3, 3) in colours (t, 3); the nearest one counts."""
    wide, high = FINER * WIDTH, FINER * HEIGHT
    near = DISTANCE / (DISTANCE - corners[:, :, 2])
    scale = 0.5 * high * ZOOM
    x = 0.5 * wide + scale * near * corners[:, :, 0]
    y = 0.5 * high - scale * near * corners[:, :, 1]
    depth = np.full((high, wide), -np.inf)
    pixels = np.zeros((high, wide, 4))
    for u, v, z, colour in zip(x, y, near, colours):
        left, right = max(0, int(u.min())), min(wide, int(u.max()) + 2)
        top, bottom = max(0, int(v.min())), min(high, int(v.max()) + 2)
        area = (u[1] - u[0]) * (v[2] - v[0]) - (u[2] - u[0]) * (v[1] - v[0])
        if area == 0.0 or left >= right or top >= bottom:
            continue
        across = np.arange(left, right) + 0.5 - u[0]
        down = np.arange(top, bottom)[:, None] + 0.5 - v[0]
        second = ((v[2] - v[0]) * across - (u[2] - u[0]) * down) / area
        third = ((u[1] - u[0]) * down - (v[1] - v[0]) * across) / area
        own = z[0] + second * (z[1] - z[0]) + third * (z[2] - z[0])
        part = np.s_[top:bottom, left:right]
        inside = (second >= -1e-6) & (third >= -1e-6) & (second + third <= 1.0 + 1e-6)
        inside &= own > depth[part]
        depth[part][inside] = own[inside]
        pixels[part][inside] = (*colour, 255.0)
    blocks = pixels.reshape(HEIGHT, FINER, WIDTH, FINER, 4)
    cover = blocks[..., 3:].mean(axis=(1, 3))
    # Pixels at the edge have the colour of what covers them.
    mean = (blocks[..., :3] * blocks[..., 3:]).mean(axis=(1, 3)) / np.maximum(cover, 1.0)
    return np.concatenate([np.rint(mean), np.rint(cover)], axis=2).astype(np.uint8)


def _png(pixels: Array) -> bytes:
    """A PNG file of pixels (h, w, 4) uint8 (ISO/IEC 15948)."""

    def chunk(name: bytes, content: bytes) -> bytes:
        check = zlib.crc32(name + content)
        return struct.pack(">I", len(content)) + name + content + struct.pack(">I", check)

    high, wide, _ = pixels.shape
    # Each row as differences from the one above (filter 2), which of plain faces are zero.
    above = np.concatenate([np.zeros_like(pixels[:1]), pixels[:-1]])
    rows = np.concatenate(
        [np.full((high, 1), 2, dtype=np.uint8), (pixels - above).reshape(high, -1)], axis=1
    )
    head = struct.pack(">IIBBBBB", wide, high, 8, 6, 0, 0, 0)
    parts = [chunk(b"IHDR", head), chunk(b"IDAT", zlib.compress(rows.tobytes(), 9))]
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts) + chunk(b"IEND", b"")
