"""Force of a contact that moves over rough surfaces: a mass on Hertz's spring.

A body that is pressed on a rough surface follows its long bumps, and its contact takes up the short
ones.  Its height y above equilibrium and the height h of the roughness below it obey

    m y'' = F(d) - F0,    F(d) = K d^(3/2) (1 + c d' / F0),    d = d0 + h - y,    K d0^(3/2) = F0

with the force F0 that presses it, Hertz's constant K, and a dashpot c; F is zero without contact
(P. R. Nayak, Contact vibrations, Journal of Sound and Vibration 22, 1972; C. N. J. Stoelinga and
A. Chaigne, Time-domain modeling and simulation of rolling objects, Acta Acustica 93, 2007; the
damping is that of Hunt and Crossley 1975).  Of waves that pass slower than the resonance of the
contact the force is m y'', of faster ones the stiffness times h; so its spectrum is highest at the
resonance.  Where bumps are higher than d0 the body leaves the surface, and the force is a row of
small impacts whose mean is F0.

Roughness within the patch of contact yields as well: it adds the approach u0 log F with u0 = 0.4 of
its height (rms), a spring of the stiffness F0 / u0 in series with Hertz's (B. N. J. Persson,
Physical Review Letters 99, 125502, 2007), which makes d0 larger.

A body does not reach into valleys narrower than itself: `trace` is the height at which a round one
touches the surface (M. Rath, An expressive real-time sound model of rolling, DAFx 2003).
"""

import numba
import numpy as np

from carillon.arrays import Array
from sound.scenes.hertz import approach

RESOLVED = 0.25
"""Largest angle [rad] of the contact's own vibration in one step of its integration."""
YIELDING = 0.4
"""Approach by which the force of a rough contact falls to 1 / e, over the height (rms) of the
roughness."""
FEWEST_STEPS, MOST_STEPS = 4, 64
"""Fewest and most steps in one sample."""
REACH = 4.0
"""Greatest height of the body, over that of roughness and approach together: the engine follows
larger hops."""


def relative_force(
    heights: Array,
    within: Array,
    forces: Array,
    radius: float,
    modulus: float,
    dashpots: Array,
    mass: float,
    rate: int,
) -> Array:
    """Fluctuation (s,) of the force of a rough contact over the force that presses it.

    `heights` (s,) [m] are those of the surface under it, `within` (s,) [m] the height (rms) of the
    roughness within the patch of contact, `forces` (s,) [N] and `dashpots` (s,)
    [N s/m] those of the contact; effective radius [m], modulus [Pa] and mass [kg] are those of
    `sound.scenes.hertz`, the rate is in Hz.

    Examples
    --------
    A flat surface leaves the force as it is; a step presses at once:

    >>> flat, ones = np.zeros(4), np.ones(4)
    >>> relative_force(flat, flat, ones, 0.01, 1e10, ones, 0.1, 44_100).tolist()
    [0.0, 0.0, 0.0, 0.0]
    >>> step = np.array([0.0, 0.0, 1e-7, 1e-7])
    >>> bool(relative_force(step, flat, ones, 0.01, 1e10, ones, 0.1, 44_100)[2] > 0.0)
    True
    """
    depths = approach(forces, radius, modulus) + 1.5 * YIELDING * within
    fastest = float(np.sqrt((1.5 * forces / depths).max() / mass))
    steps = int(np.clip(np.ceil(fastest / (RESOLVED * rate)), FEWEST_STEPS, MOST_STEPS))
    most = REACH * (float(np.abs(heights).max(initial=0.0)) + float(depths.max()))
    losses = dashpots / forces
    return np.asarray(_follow(heights, forces, depths, losses, mass, 1.0 / rate, steps, most))


@numba.njit(cache=True, nogil=True)
def trace(way: Array, heights: Array, radius: float) -> Array:
    """Height (s,) [m] above a profile at which a body of a radius [m] touches it, from its lowest
    point.

    The profile has heights (s,) [m] at ascending places `way` (s,) [m].  What touches at x' lifts
    the body at x to h(x') - (x - x')^2 / (2 R); the largest of these counts, found in one pass as
    by P. Felzenszwalb and D. Huttenlocher, Distance transforms of sampled functions, 2012.
    """
    count = len(way)
    top = np.zeros(count, dtype=np.int64)
    begin = np.zeros(count + 1)
    last = -1
    for n in range(count):
        begins = -np.inf
        hidden = False
        while last >= 0:
            peak = top[last]
            apart = way[n] - way[peak]
            if apart <= 0.0:
                if heights[n] <= heights[peak]:
                    hidden = True
                    break
                last -= 1
                continue
            middle = 0.5 * (way[n] + way[peak])
            begins = middle + radius * (heights[peak] - heights[n]) / apart
            if begins > begin[last]:
                break
            last -= 1
            begins = -np.inf
        if hidden:
            continue
        last += 1
        top[last] = n
        begin[last] = begins
    begin[last + 1] = np.inf
    traced = np.zeros(count)
    at = 0
    for n in range(count):
        while begin[at + 1] < way[n]:
            at += 1
        peak = top[at]
        traced[n] = heights[peak] - (way[n] - way[peak]) ** 2 / (2.0 * radius)
    return traced


@numba.njit(cache=True, nogil=True)
def _follow(heights, forces, depths, losses, mass, seconds, steps, most):  # type: ignore[no-untyped-def]
    felt = np.zeros(len(heights))
    height, speed = heights[0], 0.0
    below = heights[0]
    step = seconds / steps
    for n in range(len(heights)):
        climb = (heights[n] - below) / seconds
        total = 0.0
        for part in range(steps):
            ground = below + (part + 1) * step * climb
            depth = depths[n] + ground - height
            push = 0.0
            if depth > 0.0:
                push = (depth / depths[n]) ** 1.5 * (1.0 + losses[n] * (climb - speed))
                push = max(push, 0.0)
            total += push
            speed += step * (push - 1.0) * forces[n] / mass
            height += step * speed
            if height > most:
                height, speed = most, min(speed, 0.0)
        below = heights[n]
        felt[n] = total / steps - 1.0
    return felt
