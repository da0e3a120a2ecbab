"""Noise of a clip's rest: tones in the rest are lowered to the level of the noise around them.

Otherwise a played rest would contain partials that were not found as modes, with any material and
at any point.
"""

import numpy as np

from carillon.arrays import Array

FRAME_SECONDS = (0.08, 0.02)
"""Lengths of the short-time spectra, one after the other: long ones resolve tones 50 Hz apart,
short ones show tones that decay quickly."""
OVERLAP = 4
"""Number of spectra of one length that contain a sample."""
AROUND_HERTZ = 400.0
"""Half-width [Hz] of the neighbourhood that a frequency is compared with."""
STANDS_OUT = 10.0
"""Least power of a tone over the median of its neighbourhood; a thousandth of noise reaches it."""
LOBE = 2
"""Half-width of a tone in the spectrum, by the window [frequencies of the spectrum]."""
FADE_SECONDS = 0.002
"""Time over which powers are compared, so that no tone is removed before it begins."""


def noise_part(rest: Array, rate: int) -> tuple[Array, float]:
    """Noise (s,) of a clip's rest, and the share of the rest's energy that is not noise, 0 to 1.

    Broadband sound stays, as short as a click or as long as a hiss.  Where the power at a frequency
    stands out of that at frequencies around it at the same time, it is lowered to theirs.  A tone
    that decays within some milliseconds counts as a click.

    Parameters
    ----------
    rest : (s,)
        A clip without its modes.
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
    """Tones (s,) of a rest, by spectra of `seconds`."""
    from scipy.signal import ShortTimeFFT, get_window  # Slow to load.

    length = OVERLAP * max(2 * LOBE, round(seconds * rate / OVERLAP))
    transform = ShortTimeFFT(get_window("hann", length), length // OVERLAP, rate)
    padded = np.pad(rest, length)  # spectra of the ends reach beyond them
    spectra = transform.stft(padded)
    out = 1.0 - _gains(np.abs(spectra), round(AROUND_HERTZ * length / rate))
    return np.asarray(transform.istft(out * spectra, k1=len(padded))[length:-length])


def _gains(magnitudes: Array, reach: int) -> Array:
    """Factors (f, t) that lower magnitudes of tones to the median around them; 1 elsewhere."""
    from scipy.ndimage import binary_dilation, median_filter

    # As one long row: scipy's one-dimensional filter takes a tenth of the time of the other.
    rows = np.pad(magnitudes.T, ((0, 0), (reach, reach)), mode="symmetric")
    medians = median_filter(rows.ravel(), 2 * reach + 1).reshape(rows.shape)
    around = medians[:, reach:-reach].T
    tones = magnitudes**2 > STANDS_OUT * around**2
    tones = binary_dilation(tones, np.ones((2 * LOBE + 1, 1), bool))
    high = tones & (magnitudes > around)
    return np.asarray(np.divide(around, magnitudes, out=np.ones_like(magnitudes), where=high))


def _begun(tones: Array, rest: Array, rate: int) -> Array:
    """Tones limited to the power of the rest: spectra smear them to before they begin."""
    from scipy.ndimage import uniform_filter1d

    size = max(1, round(FADE_SECONDS * rate))
    # Running sums of squares may round to below 0.
    power, most = (np.maximum(uniform_filter1d(each**2, size), 0.0) for each in (tones, rest))
    share = np.divide(most, power, out=np.ones_like(power), where=power > most)
    return np.asarray(np.sqrt(share) * tones)
