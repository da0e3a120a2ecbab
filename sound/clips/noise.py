"""What of a clip's rest is noise: tones that still stand in it are brought down to it.

A rest that is played along would otherwise replay the partials that were not found as modes, with
any material and at any point.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FRAME_SECONDS = (0.08, 0.02)
"""Lengths of short-time spectra, one after the other: long ones tell tones 50 Hz apart, short ones
show tones that die away at once."""
OVERLAP = 4
"""Spectra of one length that a sample is in."""
AROUND_HERTZ = 400.0
"""Distance up to which frequencies are the surroundings of one."""
STANDS_OUT = 10.0
"""Power over that of the surroundings, the median, from which on a frequency is one of a tone; a
thousandth of noise reaches it."""
LOBE = 2
"""Frequencies of a spectrum below and above a tone's that it reaches through the window."""
FADE_SECONDS = 0.002
"""Time over which loudness is compared, so that nothing is taken out before it sounds."""


def noise_part(rest: Array, rate: int) -> tuple[Array, float]:
    """Noise (s,) of a clip's rest, and the share of the rest's energy that it lacks, 0 to 1.

    What is broad in frequency stays, be it as short as a click or as long as a hiss.  Where power
    stands out of that at the frequencies around it, at the same time, it gets theirs.  A tone that
    dies away within some milliseconds passes for a click.

    Parameters
    ----------
    rest : (s,)
        A clip less its modes.
    rate : int [Hz]
        Samples per second.

    Examples
    --------
    >>> t = np.arange(8000) / 8000
    >>> hiss = 0.01 * np.random.default_rng(0).normal(size=8000)
    >>> noise, share = noise_part(hiss + np.sin(2 * np.pi * 440 * t), 8000)
    >>> share > 0.99, 0.009 < noise[1000:7000].std() < 0.011
    (True, True)
    """
    energy = float(rest @ rest)
    if energy == 0.0:
        return rest, 0.0
    noise = rest
    for seconds in FRAME_SECONDS:
        noise = noise - _begun(_tones(noise, rate, seconds), noise, rate)
    return noise, min(1.0, max(0.0, 1.0 - float(noise @ noise) / energy))


def _tones(rest: Array, rate: int, seconds: float) -> Array:
    """What stands out of spectra that are some `seconds` long."""
    from scipy.signal import ShortTimeFFT, get_window  # Slow to load.

    length = OVERLAP * max(2 * LOBE, round(seconds * rate / OVERLAP))
    transform = ShortTimeFFT(get_window("hann", length), length // OVERLAP, rate)
    padded = np.pad(rest, length)  # Spectra of the ends need something beyond them.
    spectra = transform.stft(padded)
    out = 1.0 - _gains(np.abs(spectra), round(AROUND_HERTZ * length / rate))
    return np.asarray(transform.istft(out * spectra, k1=len(padded))[length:-length])


def _gains(magnitudes: Array, reach: int) -> Array:
    """Factors (f, t) that bring magnitudes of tones down to the median around them; 1 elsewhere."""
    from scipy.ndimage import binary_dilation, median_filter

    # As one long row: scipy's filter of one dimension takes a tenth of the time of that of two.
    rows = np.pad(magnitudes.T, ((0, 0), (reach, reach)), mode="symmetric")
    medians = median_filter(rows.ravel(), 2 * reach + 1).reshape(rows.shape)
    around = medians[:, reach:-reach].T
    tones = magnitudes**2 > STANDS_OUT * around**2
    tones = binary_dilation(tones, np.ones((2 * LOBE + 1, 1), bool))
    high = tones & (magnitudes > around)
    return np.asarray(np.divide(around, magnitudes, out=np.ones_like(magnitudes), where=high))


def _begun(tones: Array, rest: Array, rate: int) -> Array:
    """Tones no louder than the rest they are of: spectra smear them ahead of where they begin."""
    from scipy.ndimage import uniform_filter1d

    size = max(1, round(FADE_SECONDS * rate))
    # Running sums of squares may round to less than nothing.
    power, most = (np.maximum(uniform_filter1d(each**2, size), 0.0) for each in (tones, rest))
    share = np.divide(most, power, out=np.ones_like(power), where=power > most)
    return np.asarray(np.sqrt(share) * tones)
