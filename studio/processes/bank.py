"""The bank of a solid: what every point of its surface sounds like, as the page gets it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from sound.clips.targets import Targets
from sound.design.bark import bark
from sound.design.cents import cents, rms_cents
from sound.rendering.listening import near_weights
from sound.rendering.solid import struck_amplitudes
from studio.binary import pack

LOUDEST = 0.5
"""Peak of the loudest strike of a solid without clips, as a share of full scale."""


@dataclass(frozen=True)
class Heard:
    """Modes of a solid as they sound.

    Attributes
    ----------
    hertz : (N,) [Hz]
        Frequencies.
    dampings : (N,) [1/s] or None
        Own ones, if they are not the clips'.
    pushed : (V, N) [kg^-1/2]
        Of unit impulses inwards at the surface's vertices.
    young : (V,) [Pa]
        Modulus at these.
    """

    hertz: Array
    dampings: Array | None
    pushed: Array
    young: Array


@dataclass(frozen=True)
class Aim:
    """Targets and the vertices (T,) that they are struck at."""

    targets: Targets
    vertices: NDArray[np.integer]


def bank(heard: Heard, positions: Array, aim: Aim | None, header: dict[str, Any]) -> bytes:
    """The message `bank`; modes ascend, and are as loud as `sound render` has them.

    Parameters
    ----------
    positions : (V, 3) [m]
        Of the vertices.
    aim
        What the solid shall sound like, if anything.
    header
        Further keys.
    """
    order = np.argsort(heard.hertz, kind="stable")
    hertz, pushed = heard.hertz[order], heard.pushed[:, order]
    dampings = None if heard.dampings is None else heard.dampings[order]
    gains = struck_amplitudes(pushed, hertz)
    told: dict[str, Any] = {"targets": [], "wanted_hertz": None, "cents": None, "bark": None}
    told["rms_cents"] = None
    struck = np.empty((0, len(hertz)))
    if aim is None:
        loudest = float(gains.sum(axis=1).max())
        gains = gains * (LOUDEST / loudest if loudest > 0.0 else 0.0)
    else:
        targets, wanted = aim.targets, aim.targets.frequencies
        loudness = targets.amplitudes.max(axis=1) / gains[aim.vertices].max(axis=1)
        weights = near_weights(positions[aim.vertices], positions)
        gains = gains * (weights @ loudness)[:, None]
        struck = gains[aim.vertices]
        dampings = targets.dampings if dampings is None else dampings
        told = {
            "targets": list(targets.names),
            "wanted_hertz": wanted.tolist(),
            "cents": cents(hertz, wanted).tolist(),
            "bark": (bark(hertz) - bark(wanted)).tolist(),
            "rms_cents": rms_cents(hertz, wanted),
        }
    assert dampings is not None
    return pack(
        {"event": "bank", **told, **header},
        {
            "hertz": ("f8", hertz),
            "dampings": ("f8", dampings),
            "gains": ("f4", gains),
            "young": ("f4", heard.young),
            "struck": ("f8", struck),
        },
    )
