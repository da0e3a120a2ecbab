"""Random profiles of rough surfaces along the way of a rolling or sliding contact.

A profile is a sum of octaves of smooth random waves, whose heights fall with the wavelength as
those of a self-affine surface (B. Persson, Surface Science Reports 61, 2006).  Waves shorter than
the patch of contact are left out.
"""

from __future__ import annotations

import numba
import numpy as np

from carillon.arrays import Array

LONGEST_WAVE = 5e-3
"""Greatest wavelength [m] of roughness; longer ones belong to the shape of the surface."""
OCTAVES = 10
"""Number of octaves of wavelengths."""
HURST = 0.8
"""Hurst exponent: heights of waves go as the wavelength to this power."""
_LATTICE_RMS = 0.49
"""Root mean square height of the waves of one octave of unit height; a test measures it."""


def octave_heights(rms: float) -> Array:
    """Root mean square heights (o,) [m] of the octaves, longest first, of a roughness [m]."""
    heights = 2.0 ** (-HURST * np.arange(OCTAVES))
    return np.asarray(rms * heights / np.linalg.norm(heights))


def profile(way: Array, speeds: Array, patches: Array, rms: float, seed: int, rate: int) -> Array:
    """Heights (s,) [m] of a surface under a moving contact.

    Parameters
    ----------
    way : (s,) [m]
        Distance covered at each sample.
    speeds : (s,) [m/s]
        Speed at each sample; waves passed faster than half the sampling rate are left out.
    patches : (s,) [m]
        Diameters of the patch of contact.
    rms : float [m]
        Root mean square roughness.
    seed : int
        Seed of the surface.
    rate : int [Hz]
        Samples per second.
    """
    heights = octave_heights(rms) / _LATTICE_RMS
    return np.asarray(_profile(way, speeds, patches, heights, np.uint64(seed), float(rate)))


@numba.njit(cache=True, nogil=True)
def _profile(way, speeds, patches, heights, seed, rate):  # type: ignore[no-untyped-def]
    felt = np.zeros(len(way))
    for n in range(len(way)):
        wave = LONGEST_WAVE
        for octave in range(len(heights)):
            if wave < 2.0 * patches[n] or 2.0 * speeds[n] > wave * rate:
                break
            place = 2.0 * way[n] / wave
            cell = np.floor(place)
            share = place - cell
            smooth = share * share * (3.0 - 2.0 * share)
            number = np.int64(cell)
            low = _hashed(number, octave, seed)
            high = _hashed(number + 1, octave, seed)
            felt[n] += heights[octave] * (low + smooth * (high - low))
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
