"""Sustained forces between bodies: their fluctuation by rough surfaces, and their dashpots.

The profile of a surface along the way of a rolling or sliding contact is a sum of octaves of smooth
random waves, whose heights fall with the wavelength as those of a self-affine surface (B. Persson,
Surface Science Reports 61, 2006).  The patch of contact averages waves shorter than itself: of the
wavenumber q and the patch's radius a there is left (1 + pi/4 (q a)^3)^(-1/2) (P. J. Remington,
Wheel/rail rolling noise, Journal of the Acoustical Society of America 81, 1987).  What force this
makes tells `sound.scenes.audible.rough_contact`.
"""

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter

from carillon.arrays import Array, Index
from sound.scenes.audible.contact_damping import dashpot
from sound.scenes.audible.rough_contact import relative_force, trace
from sound.scenes.contact.contacts import ContactPoints
from sound.scenes.contact.impacts import SustainedContact
from sound.scenes.hertz import patch_radius
from sound.synthesis.driven import BLOCK

LOWEST_HERTZ = 20.0
"""Frequency [Hz] below which fluctuations of a force are filtered out, as they are not heard."""
LONGEST_WAVE = 5e-3
"""Greatest wavelength [m] of roughness; longer ones belong to the shape of the surface."""
OCTAVES = 10
"""Number of octaves of wavelengths."""
HURST = 0.8
"""Hurst exponent: heights of waves go as the wavelength to this power."""
_LATTICE_RMS = 0.49
"""Root mean square height of the waves of one octave of unit height; a test measures it."""


@dataclass(frozen=True)
class SustainedForce:
    """The sustained force between two bodies, in blocks of samples."""

    pair: tuple[int, int]
    """Numbers of the bodies."""
    contacts: ContactPoints
    vertices: NDArray[np.integer]
    shares: Array
    """Points of contact in the order of time, nearest vertices of both bodies, and sustained shares
    of the forces."""
    blocks: Index
    firsts: Index
    steps: Index
    """(b,) numbers of the blocks with a force, ascending; in each, number of the first point, and
    number of the engine's steps with a force."""
    courses: Array
    dashpots: Array
    """(b, BLOCK), (b,) [N s/m]: fluctuation of the force over its mean, and dashpot of the
    contact."""

    def mean(self, values: Array) -> Array:
        """Sums of values (c, ...) over the points of each block, mean over its steps (b, ...)."""
        steps = self.steps.reshape(-1, *(1,) * (values.ndim - 1))
        return np.asarray(np.add.reduceat(values, self.firsts, axis=0) / steps)


def sustained_force(
    contact: SustainedContact,
    seconds: float,
    step_seconds: float,
    rate: int,
    seed: int,
) -> SustainedForce | None:
    """The sustained force of a pair of bodies; None if there is none.

    Its fluctuation is that of a contact over rough surfaces, see
    `sound.scenes.audible.rough_contact`.  Heights are those of the roughest
    point in each block, at random by the seed.  The scene lasts so many seconds, and a step of the
    simulation `step_seconds`; the rate is in Hz.
    """
    times = contact.contacts.steps * step_seconds
    chosen = np.flatnonzero((contact.shares > 0.0) & (times < seconds))
    if not len(chosen):
        return None
    contacts, shares = contact.contacts[chosen], contact.shares[chosen]
    blocks, firsts = np.unique((times[chosen] * rate).astype(np.int64) // BLOCK, return_index=True)
    new_step = np.diff(contacts.steps, prepend=-1) > 0
    steps = np.add.reduceat(new_step.astype(np.int64), firsts)
    forces = np.add.reduceat(shares * contacts.pressures, firsts) / steps
    points = np.add.reduceat(np.ones(len(contacts)), firsts)
    radius = 1.0 / float(contact.spots.curvatures[chosen].mean())
    modulus = 1.0 / float(contact.spots.compliances[chosen].mean())
    sliding = contacts.velocities - (
        np.einsum("ci,ci->c", contacts.velocities, contacts.normals)[:, None] * contacts.normals
    )
    pace = np.linalg.norm(sliding, axis=1) + radius * contacts.turning
    speeds = np.add.reduceat(pace, firsts) / points
    words = np.random.SeedSequence([seed, *(each + 1 for each in contact.pair)])
    rough = contact.spots.roughness[chosen]
    roughest = float(rough.max())
    # Distances at the end of each block, less those from each of its samples on.
    ahead = (np.arange(BLOCK) + 1.0) / BLOCK - 1.0
    way = (np.cumsum(speeds) * BLOCK / rate)[:, None] + (speeds * BLOCK / rate)[:, None] * ahead
    patches = patch_radius(forces, radius, modulus)
    heights = profile(
        way.ravel(),
        np.repeat(speeds, BLOCK),
        np.repeat(patches, BLOCK),
        roughest,
        int(words.generate_state(1, np.uint64)[0]),
        rate,
    )
    if roughest > 0.0:
        heights = trace(way.ravel(), heights, radius)
        heights *= np.repeat(np.maximum.reduceat(rough, firsts) / roughest, BLOCK)
    mass = float(np.median(contacts.masses))
    dashpots = dashpot(forces, radius, modulus, mass)
    pressed, damped = np.repeat(forces, BLOCK), np.repeat(dashpots, BLOCK)
    within = np.repeat(height_within(patches, roughest), BLOCK)
    fluctuation = relative_force(heights, within, pressed, radius, modulus, damped, mass, rate)
    b, a = butter(1, LOWEST_HERTZ, "highpass", fs=rate)
    courses = lfilter(b, a, fluctuation).reshape(-1, BLOCK)
    vertices = contact.spots.vertices[chosen]
    return SustainedForce(
        contact.pair, contacts, vertices, shares, blocks, firsts, steps, courses, dashpots
    )


def height_within(patches: Array, rms: float) -> Array:
    """Root mean square height [m] of a roughness [m] at waves shorter than the patches of contact.

    `patches` are radii [m].

    Examples
    --------
    >>> bool(height_within(np.array(LONGEST_WAVE), 1e-6) == 1e-6)
    True
    >>> f"{height_within(np.array(1e-4), 1e-6):.2g}"
    '7.6e-08'
    """
    return np.asarray(rms * np.minimum(2.0 * patches / LONGEST_WAVE, 1.0) ** HURST)


def octave_heights(rms: float) -> Array:
    """Root mean square heights (o,) [m] of the octaves, longest first, of a roughness [m]."""
    heights = 2.0 ** (-HURST * np.arange(OCTAVES))
    return np.asarray(rms * heights / np.linalg.norm(heights))


def profile(way: Array, speeds: Array, patches: Array, rms: float, seed: int, rate: int) -> Array:
    """Heights (s,) [m] of a surface of the roughness `rms` [m] under a contact that has covered a
    way (s,) [m].

    Waves are left out that are passed faster than half the sampling rate [Hz], by the speeds (s,)
    [m/s]; those shorter than the patch of contact, of the radii (s,) [m], are averaged by it.
    """
    heights = octave_heights(rms) / _LATTICE_RMS
    return np.asarray(_profile(way, speeds, patches, heights, np.uint64(seed), float(rate)))


@numba.njit(cache=True, nogil=True)
def _profile(way, speeds, patches, heights, seed, rate):  # type: ignore[no-untyped-def]
    felt = np.zeros(len(way))
    for n in range(len(way)):
        wave = LONGEST_WAVE
        for octave in range(len(heights)):
            if 2.0 * speeds[n] > wave * rate:
                break
            left = 1.0 / np.sqrt(1.0 + 0.25 * np.pi * (2.0 * np.pi * patches[n] / wave) ** 3)
            place = 2.0 * way[n] / wave
            cell = np.floor(place)
            share = place - cell
            smooth = share * share * (3.0 - 2.0 * share)
            number = np.int64(cell)
            low = _hashed(number, octave, seed)
            high = _hashed(number + 1, octave, seed)
            felt[n] += left * heights[octave] * (low + smooth * (high - low))
            wave *= 0.5
    return felt


@numba.njit(cache=True, nogil=True)
def _hashed(cell, octave, seed):  # type: ignore[no-untyped-def]
    """A pseudorandom number from -1 to 1 by cell, octave and seed (splitmix64)."""
    x = np.uint64(cell) * np.uint64(0x9E3779B97F4A7C15) + seed
    x += np.uint64(octave) * np.uint64(0xD1B54A32D192ED03)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    x = x ^ (x >> np.uint64(31))
    return np.float64(x >> np.uint64(11)) * 2.0**-52 - 1.0
