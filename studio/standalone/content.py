"""What a page of a design holds of it: surface, material, modes, targets, in few bytes."""

from __future__ import annotations

from pathlib import PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sound.design.cents import cents, rms_cents
from sound.project.design import Design
from sound.rendering.listening import Listening, near_weights
from sound.rendering.solid import SoundingSolid
from studio.binary import pack

Array = NDArray[np.float64]

STEPS = 65_535
"""Into which the longest side of the solid, and the range of its moduli, are divided."""
GAIN_ERROR = 2.0**-11
"""Largest relative error of gains of half precision, 0.004 dB; below a 16,000th of a mode's loudest
gain they lose more, where nobody hears it beside the others."""
AT_ONCE = 4096
"""Vertices whose modes are looked at together."""


def content(design: Design) -> bytes:
    """A message as `studio.binary` has them, which the page reads.

    Positions have steps of a 65,535th of the longest side, moduli of that share of their range of
    logarithms, gains the error `GAIN_ERROR`; frequencies and dampings are as they are.
    """
    solid = SoundingSolid.of_design(design)
    listening = Listening.of_design(design, solid)
    positions = design.surface_vertices
    gains = _gains(design, solid, listening)
    loudest = gains.max(axis=0)
    shares = np.divide(gains, loudest, out=np.zeros_like(gains), where=loudest > 0.0)
    low = positions.min(axis=0)
    side = float(np.ptp(positions, axis=0).max()) or 1.0
    young = np.log10(_young_at(design, positions))
    wide = float(np.ptp(young)) or 1.0
    targets = design.targets
    header: dict[str, Any] = {
        "event": "design",
        "name": name_of(design),
        "targets": [{"name": each.name, "vertex": int(each.vertex)} for each in design.strikes],
        "amplitudes": targets.amplitudes.tolist(),
        "cents": cents(solid.frequencies, targets.frequencies).tolist(),
        "rms_cents": rms_cents(solid.frequencies, targets.frequencies),
        "origin_m": low.tolist(),
        "step_m": side / STEPS,
        "young_log10_pa": [float(young.min()), wide / STEPS],
    }
    small = "u2" if len(positions) <= STEPS else "u4"
    # One mode after the other, and all high bytes together: what is alike takes fewer bytes.
    halves = np.ascontiguousarray(shares.T).astype("<f2").view("u1").reshape(-1, 2).T
    return pack(
        header,
        {
            "hertz": ("f8", solid.frequencies),
            "dampings": ("f8", solid.dampings),
            "wanted_hertz": ("f8", targets.frequencies),
            "wanted_dampings": ("f8", targets.dampings),
            "loudest": ("f8", loudest),
            "halves": ("u2", np.ascontiguousarray(halves).ravel().view("<u2")),
            "places": ("u2", np.rint((positions - low) / side * STEPS).T),
            "young": ("u2", np.rint((young - young.min()) / wide * STEPS)),
            "triangles": (small, design.surface_faces),
        },
    )


def name_of(design: Design) -> str:
    """What the solid is called: the name of its mesh, without folders."""
    mesh = str(design.settings.get("mesh", "")) or "solid"
    return PurePath(mesh.removeprefix("builtin:")).stem or "solid"


def _gains(design: Design, solid: SoundingSolid, listening: Listening) -> Array:
    """What 1 N s inwards at each vertex lets the modes sound with (V, N) [full scale]."""
    import trimesh

    from sound.strikes import inward_normals

    surface = trimesh.Trimesh(design.surface_vertices, design.surface_faces, process=False)
    positions = design.surface_vertices
    inward = inward_normals(surface, positions)
    gains = np.empty((len(positions), len(solid.frequencies)))
    for first in range(0, len(positions), AT_ONCE):
        part = slice(first, first + AT_ONCE)
        loudness = near_weights(listening.positions, positions[part]) @ listening.gains
        gains[part] = solid.amplitudes(positions[part], inward[part]) * loudness[:, None]
    return gains


def _young_at(design: Design, positions: Array) -> Array:
    """Moduli (V,) [Pa] of the fine cells that are nearest to points (V, 3) [m]."""
    from scipy.spatial import cKDTree

    centres = design.fine_origin + design.fine_edge * (design.fine_grid + 0.5)
    return np.asarray(design.young[cKDTree(centres).query(positions)[1]])
