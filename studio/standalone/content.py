"""What a page of a design holds of it: surface, material, modes, targets, in few bytes."""

from typing import Any

import numpy as np

from carillon.arrays import Array
from sound.design.pitch import cents, partials_alone, rms_off_partials
from sound.project.design import Design
from sound.rendering.listening import Listening, near_weights
from sound.rendering.solid import SoundingSolid
from studio.binary import pack

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
    loudest, halves = halved(_gains(design, solid, listening))
    low, step, places = stepped(positions)
    young = np.log10(design.young_near(positions))
    wide = float(np.ptp(young)) or 1.0
    targets = design.targets
    header: dict[str, Any] = {
        "event": "design",
        "name": design.name,
        "targets": [{"name": each.name, "vertex": int(each.vertex)} for each in design.strikes],
        "amplitudes": targets.amplitudes.tolist(),
        # None of modes that shall stay silent.
        "cents": partials_alone(cents(solid.frequencies, targets.frequencies), targets),
        "rms_cents": rms_off_partials(solid.frequencies, targets),
        "origin_m": low.tolist(),
        "step_m": step,
        "young_log10_pa": [float(young.min()), wide / STEPS],
    }
    return pack(
        header,
        {
            "hertz": ("f8", solid.frequencies),
            "dampings": ("f8", solid.dampings),
            "wanted_hertz": ("f8", targets.frequencies),
            "wanted_dampings": ("f8", targets.dampings),
            "loudest": ("f8", loudest),
            "halves": ("u2", halves),
            "places": ("u2", places),
            "young": ("u2", np.rint((young - young.min()) / wide * STEPS)),
            "triangles": (index_type(len(positions)), design.surface_faces),
        },
    )


def index_type(count: int) -> str:
    """The smallest type, of `studio.binary.TYPES`, that tells so many things apart."""
    return "u2" if count <= STEPS + 1 else "u4"


def stepped(positions: Array) -> tuple[Array, float, Array]:
    """Positions (V, 3) [m] as whole steps, a `STEPS`-th of the longest side each.

    Returns where they begin (3,) [m], the step [m], and places (3, V): one axis after the other.
    """
    low = positions.min(axis=0)
    step = (float(np.ptp(positions, axis=0).max()) or 1.0) / STEPS
    return low, step, np.rint((positions - low) / step).T


def halved(gains: Array) -> tuple[Array, Array]:
    """Gains (V, N) as shares of half precision of each mode's loudest one.

    Returns the loudest ones (N,), and the shares as bytes that are alike in a row: one mode after
    the other, all low bytes before all high ones, seen as V N numbers of 16 bits.
    """
    loudest = np.abs(gains).max(axis=0)
    shares = np.divide(gains, loudest, out=np.zeros_like(gains), where=loudest > 0.0)
    halves = np.ascontiguousarray(shares.T).astype("<f2").view("u1").reshape(-1, 2).T
    return loudest, np.ascontiguousarray(halves).ravel().view("<u2")


def _gains(design: Design, solid: SoundingSolid, listening: Listening) -> Array:
    """What 1 N s inwards at each vertex lets the modes sound with (V, N) [full scale]."""
    import trimesh

    from solver.response.vertices import inward_normals

    surface = trimesh.Trimesh(design.surface_vertices, design.surface_faces, process=False)
    positions = design.surface_vertices
    inward = inward_normals(surface, positions)
    gains = np.empty((len(positions), len(solid.frequencies)))
    for first in range(0, len(positions), AT_ONCE):
        part = slice(first, first + AT_ONCE)
        loudness = near_weights(listening.positions, positions[part]) @ listening.gains
        gains[part] = solid.amplitudes(positions[part], inward[part]) * loudness[:, None]
    return gains
