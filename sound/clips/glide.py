"""Glide of a clip's loudest tone: that of a drum falls in pitch while its head slackens.

No material glides.  A fit of modes does not show a glide, as a row of neighbouring modes imitates
it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array, Complex
from sound.clips.candidates import LOWEST_HERTZ, low_pass

_HALF_WIDTH = 0.15
"""Half-width of the analysed band, over its tone's frequency."""
_BAND_SAMPLES = 400
"""Greatest number of samples of the band."""
_FEWEST_SAMPLES = 24
"""Least number of samples of the band."""
_BETTER, _GOOD = 0.85, 0.15
"""Greatest energy that a gliding tone leaves unexplained, over the energy that two modes leave, and
over that of the whole band."""
LEAST_CENTS = 30.0
"""Least change of pitch that counts as a glide [cents]."""
_ENERGY = 0.9
"""Share of the band's energy within the time that the change of pitch is measured in."""
_STEPS = 40
"""Greatest number of evaluations of a least-squares fit."""


@dataclass(frozen=True)
class Glide:
    """A tone that glides from `cents` above `hertz` to `hertz`, within `seconds` of the strike."""

    hertz: float
    seconds: float
    cents: float


def glide(clip: Array, rate: int) -> Glide | None:
    """The glide of the loudest tone of a clip (s,) that begins with its strike; None if it is
    steady.

    A glide is a frequency w + u exp(-t / tau) that explains more of the band around the tone than
    two steady modes do.
    """
    power = np.abs(np.fft.rfft(clip, 2 * len(clip))) ** 2
    power[: int(2.0 * len(clip) * LOWEST_HERTZ / rate)] = 0.0
    centre = float(np.argmax(power)) * 0.5 * rate / len(clip)
    band, band_rate, ahead = _band(clip, rate, centre)
    if len(band) < _FEWEST_SAMPLES:
        return None
    energy = np.cumsum(np.abs(band) ** 2)
    lasts = (np.searchsorted(energy, _ENERGY * energy[-1]) + 3.0) / band_rate
    left, (offset, rise, tau) = _left_by_glide(band, band_rate, lasts)
    if left > _BETTER * _left_by_two(band) or left > _GOOD * energy[-1]:
        return None
    begin = -min(ahead, tau)
    start, end = (
        centre + (offset + rise * np.exp(-t / tau)) / (2.0 * np.pi) for t in (begin, lasts)
    )
    if min(start, end) <= 0.0 or abs(1200.0 * np.log2(start / end)) < LEAST_CENTS:
        return None
    return Glide(float(end), float(lasts), float(1200.0 * np.log2(start / end)))


def _band(clip: Array, rate: int, centre: float) -> tuple[Complex, float, float]:
    """The band around a frequency [Hz], shifted to 0, its rate [Hz], and the filter's look-ahead
    [s].

    The filter looks ahead as those of `bands` do.
    """
    from scipy.signal import oaconvolve  # Slow to load.

    width = 2.0 * max(_HALF_WIDTH * centre, LOWEST_HERTZ)
    taps = low_pass(rate, width)
    step = max(1, int(rate / (3.0 * width)))
    shifted = clip[: len(taps) + step * _BAND_SAMPLES].astype(complex)
    shifted *= np.exp(-2j * np.pi * centre / rate * np.arange(len(shifted)))
    if len(shifted) <= len(taps):
        return np.zeros(0, complex), float(rate), 0.0
    part = oaconvolve(shifted, taps[::-1], "valid")[::step][:_BAND_SAMPLES]
    return part, rate / step, 0.5 * len(taps) / rate


def _left_by_two(band: Complex) -> float:
    """Energy that one or two damped sinusoids leave unexplained, the lesser of the two."""
    from sound.clips.candidates import exponents_of_orders

    time = np.arange(len(band))

    def waves(values: Array) -> Complex:
        decays, frequencies = np.split(values, 2)
        return np.exp(np.outer(time, -np.abs(decays) + 1j * frequencies))

    of_orders = exponents_of_orders(band, (1, 2))
    starts = [np.concatenate([np.abs(each.real), each.imag]) for each in of_orders]
    return min(_fitted(band, waves, start)[0] for start in starts)


def _left_by_glide(
    band: Complex, rate: float, lasts: float
) -> tuple[float, tuple[float, float, float]]:
    """Energy that a gliding tone leaves unexplained, and its w [rad/s], u [rad/s] and tau [s]."""
    time = np.arange(len(band)) / rate
    turns = np.angle(band[1:] * band[:-1].conj()) * rate
    weights = np.abs(band[1:])[:, None]

    def waves(values: Array) -> Complex:
        decay, offset, rise, log_tau = values
        tau = np.exp(log_tau)
        phase = offset * time - rise * tau * np.expm1(-time / tau)
        return np.exp(-decay * time + 1j * phase)[:, None]

    widest = 2.0 * np.pi * rate
    bounds = (
        [0.0, -widest, -widest, np.log(lasts / 30.0)],
        [np.inf, widest, widest, np.log(3.0 * lasts)],
    )
    best = np.inf, np.zeros(4)
    for tau in (lasts / 6.0, lasts / 2.0, 1.5 * lasts):
        shape = np.stack([np.ones(len(turns)), np.exp(-time[1:] / tau)], axis=1)
        offset, rise = np.linalg.lstsq(weights * shape, weights[:, 0] * turns, rcond=None)[0]
        start = np.array([1.0 / lasts, *np.clip([offset, rise], -0.9 * widest, 0.9 * widest)])
        best = min(
            best, _fitted(band, waves, np.append(start, np.log(tau)), bounds), key=lambda x: x[0]
        )
    offset, rise, log_tau = best[1][1:]
    return best[0], (offset, rise, float(np.exp(log_tau)))


def _fitted(
    band: Complex,
    waves: Callable[[Array], Complex],
    start: Array,
    bounds: tuple[list[float], list[float]] | tuple[float, float] = (-np.inf, np.inf),
) -> tuple[float, Array]:
    """Least energy that waves of eliminated amplitudes leave unexplained, and their parameters."""
    from scipy.optimize import least_squares  # Slow to load.

    def rest(values: Array) -> Array:
        basis = waves(values)
        left = band - basis @ np.linalg.lstsq(basis, band, rcond=None)[0]
        return np.concatenate([left.real, left.imag])

    fit = least_squares(rest, start, max_nfev=_STEPS, x_scale="jac", bounds=bounds)
    return 2.0 * float(fit.cost), np.asarray(fit.x)
