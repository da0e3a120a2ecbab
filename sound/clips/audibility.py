"""Which partials of a clip are heard, and how loud each is beside the others.

Partials that the ear does not resolve count as one, bursts that die away at once as the attack.
What is left is ordered by loudness: partials spread into each other's auditory filters (Glasberg
and Moore, *Hearing Research* 47, 1990), and each is as loud as what the loudness in its own filter
loses without it (Moore, Glasberg and Baer, *J. Audio Eng. Soc.* 45, 1997), summed over time.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import trapezoid

from carillon.arrays import Array, Flags
from carillon.command_line.counts import counted
from sound.clips.extraction import ModalSound
from sound.synthesis.sinusoids import damped_sinusoids

BURST_QUALITY, BURST_DAMPING = 10.0, 1000.0
"""Quality factor pi f / d below which, and damping [1/s] beyond which, a partial is a burst: it is
over in three periods, or in 7 ms."""
RESOLVED = 0.5
"""Distance [ERB] below which partials are heard as one; tones of a chord are heard out from about
one ERB on (Moore and Ohgushi, *J. Acoust. Soc. Am.* 93, 1993)."""
LEAST_SHARE, ENOUGH = 0.01, 0.97
"""Least share of a partial in a clip's loudness, and share of all that are kept together."""
LEAST_AMPLITUDE = 0.01
"""Least amplitude of a partial at the strike, over the loudest: where a mode rings on for seconds
40 dB below the others, no other mode may sound."""
_LOUDEST = 70.0
"""Level [dB SPL] at which a clip is taken to be heard."""
_WINDOW = 0.01
"""Time constant [s] with which the ear smooths powers."""
_EXPONENT = 0.23
"""Exponent of the power in an auditory filter that gives loudness (Zwicker and Fastl)."""
_TIMES = np.concatenate([np.arange(0.0, 0.02, 5e-4), np.geomspace(0.02, 1.5, 60)])
"""Times after the strike [s] over which loudness is summed."""


def heard_partials(sound: ModalSound) -> ModalSound:
    """A clip with the partials that are heard, in place of its modes; bursts join the residual.

    Partials less than `RESOLVED` apart become the loudest of them, with the energy of all. The
    loudest are kept that together make `ENOUGH` of the loudness, none of less than `LEAST_SHARE`
    or `LEAST_AMPLITUDE`. A clip of bursts alone stays as it is.

    Examples
    --------
    >>> one = np.ones(4)
    >>> hertz = np.array([1401.06, 1401.9, 2045.0, 2521.0])
    >>> dampings = np.array([9.0, 9.0, 9.0, 1796.0])
    >>> sound = ModalSound(hertz, dampings, one, one, np.zeros(100), 44100, {})
    >>> heard_partials(sound).frequencies.tolist()
    [1401.9, 2045.0]
    """
    burst = is_burst(sound)
    if burst.all():
        return sound
    attack = chosen(sound, burst)
    values = (attack.frequencies, attack.dampings, attack.amplitudes, attack.phases)
    rest = sound.residual + damped_sinusoids(*values, sound.rate, len(sound.residual))
    merged = _merged(replace(chosen(sound, ~burst), residual=rest))
    shares = _shares(merged)
    shares[merged.amplitudes < LEAST_AMPLITUDE * merged.amplitudes.max()] = 0.0
    order = np.argsort(-shares, kind="stable")
    shares /= shares.sum()
    enough = int(np.searchsorted(shares[order].cumsum(), ENOUGH)) + 1
    kept = order[:enough][shares[order[:enough]] >= LEAST_SHARE]
    return chosen(merged, np.sort(kept))


def heard_in_words(hertz: Iterable[float]) -> str:
    """Frequencies [Hz] of the partials of a clip that are heard, in words.

    Examples
    --------
    >>> heard_in_words([440.0, 990.2])
    '2 partials are heard and count for a design: 440, 990 Hz'
    >>> heard_in_words([440.0])
    '1 partial is heard and counts for a design: 440 Hz'
    """
    listed = [f"{each:.0f}" for each in hertz]
    count = "is heard and counts" if len(listed) == 1 else "are heard and count"
    return f"{counted(len(listed), 'partial')} {count} for a design: {', '.join(listed)} Hz"


def is_burst(sound: ModalSound) -> Flags:
    """Which modes (n,) of a clip are over at once, and belong to its attack."""
    quality = np.pi * sound.frequencies / sound.dampings
    return np.asarray((quality < BURST_QUALITY) | (sound.dampings > BURST_DAMPING))


def chosen(sound: ModalSound, which: NDArray[np.generic]) -> ModalSound:
    """A clip with some of its modes, by flags or numbers; the residual stays as it is."""
    names = ("frequencies", "dampings", "amplitudes", "phases")
    return replace(sound, **{name: getattr(sound, name)[which] for name in names})


def loudness_shares(hertz: Array, dampings: Array, amplitudes: Array) -> Array:
    """Shares (n,) of partials in the loudness of all of them, which add up to 1.

    They have frequencies (n,) [Hz], dampings (n,) [1/s], and amplitudes (n,) at the strike, not all
    0.

    Examples
    --------
    >>> hertz, dampings = np.array([500.0, 520.0, 4000.0]), np.full(3, 9.0)
    >>> loudness_shares(hertz, dampings, np.array([1.0, 0.01, 0.3])).round(2).tolist()
    [0.62, 0.0, 0.38]
    """
    # A decaying power behind a window that forgets by exp(-t / _WINDOW).
    early = np.exp(-2.0 * np.outer(dampings, _TIMES)) - np.exp(-_TIMES / _WINDOW)
    lag = 1.0 - 2.0 * _WINDOW * dampings
    lag = np.where(np.abs(lag) < 1e-9, 1e-9, lag)
    power = np.maximum(amplitudes[:, None] ** 2 * early / lag[:, None], 0.0)
    power *= 10.0 ** (_LOUDEST / 10.0) / power.sum(axis=0).max()
    excitation = _spread(hertz) @ power
    quiet = _threshold_in_quiet(hertz)[:, None]
    with_it, without = excitation + quiet, excitation - power + quiet
    loudness = trapezoid(with_it**_EXPONENT - without**_EXPONENT, _TIMES, axis=1)
    return np.asarray(loudness / loudness.sum())


def _shares(sound: ModalSound) -> Array:
    return loudness_shares(sound.frequencies, sound.dampings, sound.amplitudes)


def erb_number(hertz: Array) -> Array:
    """Place of frequencies [Hz] on the scale of auditory filters [ERB] (Glasberg and Moore).

    Examples
    --------
    >>> erb_number(np.array([1000.0])).round(1).tolist()
    [15.6]
    """
    return np.asarray(21.4 * np.log10(1.0 + 4.37e-3 * np.asarray(hertz)))


def _spread(hertz: Array) -> Array:
    """Share (n, n) of the power of partial j that passes the filter around partial i."""
    widths = 24.7 * (4.37e-3 * hertz + 1.0)
    distance = np.abs(hertz[None, :] - hertz[:, None]) * (4.0 / widths)[:, None]
    return np.asarray((1.0 + distance) * np.exp(-distance))


def _threshold_in_quiet(hertz: Array) -> Array:
    """Powers (n,) that are just heard alone (Terhardt, *Hearing Research* 1, 1979), 0 dB SPL being
    1."""
    k = hertz / 1000.0
    level = 3.64 * k**-0.8 - 6.5 * np.exp(-0.6 * (k - 3.3) ** 2) + 1e-3 * k**4
    return np.asarray(10.0 ** (np.minimum(level, 90.0) / 10.0))


def _merged(sound: ModalSound) -> ModalSound:
    """A clip whose partials less than `RESOLVED` apart are one."""
    places = erb_number(sound.frequencies)
    kept: list[int] = []
    owner = np.zeros(len(places), dtype=int)
    for mode in np.argsort(-_shares(sound), kind="stable"):
        near = [each for each in kept if abs(places[mode] - places[each]) < RESOLVED]
        if not near:
            kept.append(int(mode))
        owner[mode] = min(near, key=lambda each: abs(places[mode] - places[each]), default=mode)
    leading = np.sort(kept)
    one = chosen(sound, leading)
    joint = [_joint(chosen(sound, np.flatnonzero(owner == each))) for each in leading]
    amplitudes, dampings = np.array(joint).T
    return replace(one, amplitudes=amplitudes, dampings=dampings)


def _joint(sound: ModalSound) -> tuple[float, float]:
    """Amplitude and damping [1/s] of one partial in place of modes that beat.

    It has the energy of their sum, and that at the same mean time.
    """
    exponents = -sound.dampings + 2j * np.pi * sound.frequencies
    coefficients = sound.amplitudes * np.exp(1j * sound.phases)
    products = np.outer(coefficients, coefficients.conj())
    sums = exponents[:, None] + exponents.conj()
    energy = float(-(products / sums).sum().real)
    moment = float((products / sums**2).sum().real)
    damping = energy / (2.0 * moment)
    return float(np.sqrt(2.0 * damping * energy)), damping
