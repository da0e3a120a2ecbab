"""Candidates for the modes of a clip: damped sinusoids that ESPRIT finds in its bands."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from carillon.arrays import Array, Complex
from carillon.command_line.progress import track

BAND_SAMPLES = 512
"""Greatest number of samples of a band, from the strike on; those of a narrow band last longer."""
BAND_DECAY = 5.0
"""Decay within a band's length [nepers] above which a mode is sought again in wider bands."""
LOWEST_HERTZ, HIGHEST_FRACTION = 20.0, 0.97
"""Lowest frequency of a mode [Hz], and the highest over half the sampling rate."""
LEAST_QUALITY = 2.0
"""Least quality factor pi f / d of a mode; a quicker decay makes a knock."""
LEAST_DECAY = 0.1
"""Least decay of a mode within the clip [nepers] (0.87 dB); a slower decay makes a steady tone."""
_MOST_GROWTH = 5.0
"""Greatest growth of a sinusoid within the clip [nepers]; growing ones show that a clip does not
decay."""
_LATER = 16
"""Delay of the second search in a band [samples]."""
MOST = 200
"""Greatest number of candidates of one pass over the bands."""
_PEAK = 20.0
"""Largest over median power of a band's spectrum below which the band counts as noise."""
_STOP_DECIBELS = 80.0
"""Attenuation of the filter outside of a band [dB]."""
MOST_EXPONENTS = 40
"""Greatest number of exponents of one signal."""
_ESTER_FRACTION = 0.02
"""Least criterion of the number of sinusoids, over its maximum."""


@dataclass(frozen=True)
class Band:
    """A part of a clip's spectrum, shifted to frequency 0.

    The samples `signal` (n,) have a `rate` [Hz] of at least twice the band's `width` [Hz]; its
    sinusoids lie within half of that of `centre` [Hz].
    """

    centre: float
    width: float
    rate: float
    signal: Complex


def candidates(rest: Array, rate: int, width: float, label: str, visible: bool) -> Complex:
    """Exponents (k,) per sample of the sinusoids in all bands of `width` [Hz] of a rest.

    The `MOST` of greatest energy are kept.  Otherwise a clip that ends in mid-tone, without noise,
    would take minutes, as its end leaves traces in all bands.
    """
    count = int(0.5 * rate / width) + 1
    parts = track(bands(rest, rate, width, BAND_SAMPLES), label, count, visible=visible)
    most = _MOST_GROWTH / len(rest)
    of_bands = [_band_exponents(band, rate, most) for band in parts]
    exponents = np.concatenate([each for each, _ in of_bands])
    energies = np.concatenate([energies for _, energies in of_bands])
    return exponents[np.sort(np.argsort(-energies, kind="stable")[:MOST])]


def _band_exponents(band: Band, rate: int, growth: float) -> tuple[Complex, Array]:
    """Exponents (k,) per sample of the clip, and the energy (k,) that each has in the band.

    None grows by more than `growth` nepers a sample.
    """
    nothing = np.zeros(0, complex), np.zeros(0)
    power = np.abs(np.fft.fft(band.signal)) ** 2
    if len(power) < 4 * _LATER or power.max() < _PEAK * np.median(power):
        return nothing
    own = _stable(band.signal)
    energies = _energies(own, band.signal)
    exponents = own * band.rate / rate
    inside = np.abs(exponents.imag) * rate <= np.pi * band.width
    exponents = exponents[inside] + 2j * np.pi * band.centre / rate
    low, high = 2.0 * np.pi * LOWEST_HERTZ / rate, HIGHEST_FRACTION * np.pi
    sounds = (exponents.imag > low) & (exponents.imag < high) & rings(exponents)
    kept = sounds & (exponents.real <= growth)
    return exponents[kept], energies[inside][kept]


def _energies(exponents: Complex, signal: Complex) -> Array:
    if not len(exponents):
        return np.zeros(0)
    waves = np.exp(np.outer(np.arange(len(signal)), exponents))
    coefficients = np.linalg.lstsq(waves, signal, rcond=None)[0]
    return np.asarray((np.abs(waves * coefficients) ** 2).sum(axis=0))


def rings(exponents: Complex) -> NDArray[np.bool_]:
    """Which sinusoids have at least the quality factor `LEAST_QUALITY`."""
    return exponents.imag > -2.0 * LEAST_QUALITY * exponents.real


def _stable(signal: Complex) -> Complex:
    """Exponents per sample that ESPRIT finds from the strike on and also from a little later on.

    The exponents of a blow's noise change altogether, while that of a mode moves by less than its
    decay, or by less than the resolution of so short a signal.
    """
    exponents, later = esprit(signal), esprit(signal[_LATER:])
    moved = np.abs(exponents[:, None] - later).min(axis=1)
    return exponents[moved < np.maximum(-exponents.real, BAND_DECAY / len(signal))]


def bands(clip: Array, rate: int, width: float, samples: int) -> Iterator[Band]:
    """Bands of `width` [Hz] side by side from 0 to half the rate, `samples` long at most.

    The filter looks ahead: sample n of a band is a weighted sum of later samples of the clip, so a
    damped sinusoid stays one from the strike on, with another coefficient.  The end of the band,
    where the filter would look beyond the clip, is left out.
    """
    from scipy.fft import next_fast_len  # Slow to load.

    factor = max(1, int(rate / (2.0 * width)))
    taps = low_pass(rate, width)
    length = next_fast_len(-(-(len(clip) + len(taps)) // factor))
    spectrum = np.fft.fft(clip, factor * length)
    offsets = np.arange(length) - length // 2
    response = np.fft.fft(taps, factor * length).conj()[offsets] / factor
    kept = min(samples, max(0, len(clip) - len(taps)) // factor + 1)
    step = width * factor * length / rate
    for number in range(int(0.5 * rate / width) + 1):
        centre = round(number * step)
        part = spectrum[(centre + offsets) % (factor * length)] * response
        signal = np.fft.ifft(np.fft.ifftshift(part))[:kept]
        yield Band(centre * rate / (factor * length), width, rate / factor, signal)


def low_pass(rate: int, width: float) -> Array:
    """Taps of a filter that passes up to half the width and stops from one and a half widths on."""
    from scipy.signal import firwin, kaiserord  # Slow to load.

    if 2.0 * width >= 0.99 * rate:
        return np.ones(1)
    count, beta = kaiserord(_STOP_DECIBELS, min(0.99, 2.0 * width / rate))
    return np.asarray(firwin(count, width, window=("kaiser", beta), fs=rate))


def esprit(signal: Complex) -> Complex:
    """Exponents (p,) per sample of the damped sinusoids in `signal` (n,).

    The leading left singular vectors of the signal's Hankel matrix span what exp(lambda_k n) span,
    so that shifting them by a sample multiplies them by a matrix with eigenvalues exp(lambda_k)
    (Roy and Kailath 1989), which is found by total least squares.
    """
    vectors = _subspace(signal)
    return _exponents(vectors[:, : ester(vectors)])


def exponents_of_orders(signal: Complex, orders: Iterable[int]) -> list[Complex]:
    """Exponents (p,) of damped sinusoids in `signal` for each of some numbers p."""
    vectors = _subspace(signal)
    return [_exponents(vectors[:, :order]) for order in orders]


def _exponents(vectors: Complex) -> Complex:
    poles = la.eigvals(_rotation(vectors))
    return np.log(poles[np.abs(poles) > 0.0])


def ester(vectors: Complex) -> int:
    """Number of sinusoids: the largest order whose subspace hardly changes under a shift.

    The criterion of Badeau, David and Richard (2006): J(p) is the inverse square of the norm of
    what least squares leaves of the shift of the first p vectors; here it is the Frobenius norm,
    which needs no decomposition for each order.  J is largest at the number of sinusoids, or of the
    strong ones among them; the last order within a fiftieth of the maximum counts, as too many do
    less harm than too few.
    """
    across = vectors[:-1].conj().T @ vectors[1:]
    first, last = np.abs(vectors[0]) ** 2, np.abs(vectors[-1]) ** 2
    orders = np.arange(1, len(across) + 1)
    # As the vectors are orthonormal, their products without the first or the last row differ from
    # the identity by one of rank 1.
    explained = np.diag((np.abs(across) ** 2).cumsum(0).cumsum(1))
    rank_one = np.diag((np.abs((vectors[-1][:, None] * across).cumsum(0)) ** 2).cumsum(1))
    lost = np.maximum(1.0 - np.cumsum(last), np.finfo(float).eps)
    squares = orders - np.cumsum(first) - explained - rank_one / lost
    criterion = 1.0 / np.maximum(squares, np.finfo(float).eps)
    return int(orders[criterion >= _ESTER_FRACTION * criterion.max()][-1])


def _subspace(signal: Complex) -> Complex:
    rows = len(signal) // 3
    most = min(MOST_EXPONENTS, rows - 2)
    covariance = _covariance(signal, rows)
    vectors = la.eigh(covariance, subset_by_index=(rows - most, rows - 1))[1]
    return np.asarray(vectors[:, ::-1])


def _covariance(signal: Complex, rows: int) -> Complex:
    """Hankel matrix (rows, columns) of a signal times its own adjoint.

    An entry differs from the one up and left of it by what the rows lose and gain at their ends.
    """
    columns = len(signal) - rows + 1
    change = np.outer(signal[columns:], signal[columns:].conj())
    change -= np.outer(signal[: rows - 1], signal[: rows - 1].conj())
    matrix = np.empty((rows, rows), complex)
    matrix[0] = np.lib.stride_tricks.sliding_window_view(signal, columns).conj() @ signal[:columns]
    matrix[:, 0] = matrix[0].conj()
    for row in range(1, rows):
        matrix[row, 1:] = matrix[row - 1, :-1] + change[row - 1]
    return matrix


def _rotation(vectors: Complex) -> Complex:
    """Matrix F that makes vectors[:-1] F = vectors[1:], by total least squares."""
    order = vectors.shape[1]
    right = la.svd(np.hstack([vectors[:-1], vectors[1:]]), full_matrices=False)[2].conj().T
    upper, lower = right[:order, order:], right[order:, order:]
    return np.asarray(-upper @ la.pinv(lower))
