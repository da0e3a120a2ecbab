"""The bank of a solid: what every point of its surface sounds like, as the page gets it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Complex
from sound.clips.targets import Targets
from sound.design.pitch import bark, cents, partials_alone, rms_off_partials
from sound.rendering.clip_level import clip_level
from sound.rendering.listening import near_weights
from sound.rendering.solid import struck_amplitudes
from studio.binary import pack

LOUDEST = 0.5
"""Peak of the loudest strike of a solid without clips, as a share of full scale."""


@dataclass(frozen=True)
class Heard:
    """Modes of a solid as they sound: frequencies (N,) [Hz] and own dampings (N,) [1/s], None for
    the clips'.

    Unit impulses inwards at the surface's vertices push them by `pushed` (V, N) [kg^-1/2]; the
    modulus there is `young` (V,) [Pa].  At the place of the targets their pressures are `at_place`
    (N,) [Pa m / (kg^-1/2 N s)], None without one.
    """

    hertz: Array
    dampings: Array | None
    pushed: Array
    young: Array
    at_place: Complex | None = None


@dataclass(frozen=True)
class Aim:
    """Targets and the vertices (T,) that they are struck at."""

    targets: Targets
    vertices: NDArray[np.integer]


def bank(heard: Heard, positions: Array, aim: Aim | None, header: dict[str, Any]) -> bytes:
    """The message `bank`; modes ascend, and are as loud as `sound render` has them.

    The vertices have positions (V, 3) [m]; the header has further keys.
    """
    order = np.argsort(heard.hertz, kind="stable")
    hertz, pushed = heard.hertz[order], heard.pushed[:, order]
    dampings = None if heard.dampings is None else heard.dampings[order]
    at_place = None if heard.at_place is None else heard.at_place[order]
    gains = struck_amplitudes(pushed, hertz, at_place)
    errors: dict[str, Any] = {"targets": [], "wanted_hertz": None, "cents": None, "bark": None}
    errors |= {"rms_cents": None, "left_out_hz": []}
    struck = np.empty((0, len(hertz)))
    if aim is None:
        loudest = float(gains.sum(axis=1).max())
        gains = gains * (LOUDEST / loudest if loudest > 0.0 else 0.0)
    else:
        targets, target_hertz = aim.targets, aim.targets.frequencies
        dampings = targets.dampings if dampings is None else dampings
        level = clip_level(targets, hertz, dampings, gains[aim.vertices])
        weights = near_weights(positions[aim.vertices], positions)
        gains = gains * (weights @ level.gains)[:, None]
        struck = gains[aim.vertices]
        errors = {
            "targets": list(targets.names),
            "wanted_hertz": partials_alone(target_hertz, targets),
            "cents": partials_alone(cents(hertz, target_hertz), targets),
            "bark": partials_alone(bark(hertz) - bark(target_hertz), targets),
            "rms_cents": rms_off_partials(hertz, targets),
            "left_out_hz": [] if targets.left_out is None else targets.left_out.tolist(),
        }
    assert dampings is not None
    return pack(
        {"event": "bank", **errors, **header},
        {
            "hertz": ("f8", hertz),
            "dampings": ("f8", dampings),
            "gains": ("f4", gains),
            "young": ("f4", heard.young),
            "struck": ("f8", struck),
        },
    )
