"""How contacts damp the modes of a body."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sound.scenes.bodies import Body
from sound.scenes.hertz import stiffness

Array = NDArray[np.float64]

DAMPING_RATIO = 0.1
"""Of a contact as a spring with a damper: an assumption, for all that takes energy there."""
PLACES_AT_ONCE = 4096
"""Points whose motion in all modes is looked at together."""
_TINY = 1e-12


def dashpot(forces: Array, radius: float, modulus: float, mass: float) -> Array:
    """Force over the speed of approach [N s/m] of contacts pressed by forces [N].

    Parameters
    ----------
    radius, modulus, mass : float [m], [Pa], [kg]
        Effective ones, see `sound.scenes.hertz`.
    """
    springs = stiffness(forces, radius, modulus)
    return np.asarray(2.0 * DAMPING_RATIO * np.sqrt(springs * mass))


def moved_along(motion: Array, forces: Array) -> Array:
    """How far points that modes move by (p, 3, K) go (p, K) along the forces (p, 3) on them.

    A dashpot c along u takes the power c (u . v)^2, which damps a mode U_k by c (u . U_k)^2 / 2.
    """
    sizes = np.linalg.norm(forces, axis=1, keepdims=True)
    return np.asarray(np.einsum("pik,pi->pk", motion, forces / np.maximum(sizes, _TINY)))


def pushed_modes(body: Body, places: Array, forces: Array) -> Array:
    """How forces (p, 3) at places (p, 3) [m] in a body's axes push its modes (p, K) [kg^-1/2]."""
    assert body.solid is not None
    pushed = np.empty((len(places), len(body.solid.frequencies)))
    for first in range(0, len(places), PLACES_AT_ONCE):
        part = slice(first, first + PLACES_AT_ONCE)
        pushed[part] = np.einsum("pik,pi->pk", body.motion(places[part]), forces[part])
    return pushed
