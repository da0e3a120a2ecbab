"""Modes of a contact sound: frequencies, dampings and amplitudes from a clip of one strike.

Ren, Yeh and Lin (2013), whom the paper follows, fit peaks of spectrograms.  Here the clip is cut
into bands, ESPRIT (Roy and Kailath 1989) finds the damped sinusoids of every band, ESTER (Badeau,
David and Richard 2006) their number, and a least-squares fit to the whole clip refines them.  This
is done for narrow bands, which tell slow and close modes apart, and then, on what those leave, for
wide ones, in which modes that die away at once stand out.  What still stands out of the rest is
added, see `sound.clips.pursuit`, and what does not stand out of the noise is dropped, which is why
ESTER may be generous.

Two modes come apart if their frequencies differ by the half-power bandwidth d / pi or more where
the signal is 20 dB above the noise, by two thirds of it at 40 dB.  Errors of modes that stand apart
are what the noise makes inevitable.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.errors import UserError
from carillon.threads import blas_threads
from sound.bounds import require_level
from sound.clips.candidates import BAND_DECAY, BAND_SAMPLES, LEAST_DECAY, candidates, rings
from sound.clips.damped import damped_sinusoids, fitted_coefficients, superposed
from sound.clips.onset import strike_sample
from sound.clips.pursuit import further
from sound.clips.significance import Fit, settled

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

LONGEST_SECONDS = 6.0
"""Time after the strike that is searched for modes."""
LONGEST_BLOW = 0.03
"""Time [s] after the strike from which on modes ring freely."""
BLOW_SHARES = (0.005, 0.01, 0.025, 0.05, 0.1)
"""Shares of the energy that may come before."""
WORTH_IT = 0.95
"""Share of what is left from which on another beginning is not worth a second fit."""
SHORTEST_SAMPLES = 256
"""Samples from the strike on without which there is nothing to be searched."""
FEWEST_PERIODS = 3.0
"""Periods of a mode that a clip must hold; what has fewer is drift rather than a mode."""
PURSUITS = 6
"""Rounds in which what stands out of the rest is added."""
WIDTH_FACTORS = (1.0, 4.0, 16.0)
"""Widths of bands, one search after the other."""
_SETTLING_STEPS, _FINAL_STEPS = 4, 20
SAME = 0.25
"""Distance of two exponents, over the decay of one, below which they are one mode."""
UNDER_PEAK, DROWNED = 2.0, 0.01
"""Distance, over the decay of the louder one, and share of its amplitude, below which a sinusoid
mends the fit of another and is no mode of its own."""


@dataclass(frozen=True)
class ModalSound:
    """A contact sound as damped sinusoids and a rest.

    s(t) = sum_k a_k exp(-d_k t) sin(2 pi f_k t + theta_k) + residual, t = 0 at the strike.

    Attributes
    ----------
    frequencies : (n,) [Hz]
        Ascending.
    dampings : (n,) [1/s]
        d.
    amplitudes : (n,)
        At the strike, in units of the samples.
    phases : (n,) [rad]
        theta.
    residual : (s,)
        The clip from the strike on minus all modes found, those not asked for included.
    rate : int [Hz]
        Samples per second.
    evidence : dict
        How the modes were found and how sure they are; plain values.
    """

    frequencies: Array
    dampings: Array
    amplitudes: Array
    phases: Array
    residual: Array
    rate: int
    evidence: dict[str, Any]

    @property
    def energies(self) -> Array:
        """Energy (n,) of each mode, its squared samples summed over all time."""
        return np.asarray(self.amplitudes**2 * self.rate / (4.0 * self.dampings))

    def modal_part(self) -> Array:
        """Samples (s,) of the modes alone, as many as the residual has."""
        values = (self.frequencies, self.dampings, self.amplitudes, self.phases)
        return damped_sinusoids(*values, self.rate, len(self.residual))


def extract(
    samples: Array, rate: int, modes: int | None = None, visible: bool = False
) -> ModalSound:
    """Modes of the one contact sound that a clip holds.

    Parameters
    ----------
    samples : (s,)
        Of one channel.
    rate : int [Hz]
        Samples per second.
    modes : int or None
        Number of modes to keep, those with most energy; all that are found if None.
    visible : bool
        Whether progress is shown.

    Raises
    ------
    UserError
        If the clip is silent or far beyond full scale, has no modes or fewer than asked for, does
        not decay, or is shorter than three periods of its lowest mode.

    Examples
    --------
    >>> from sound.clips.damped import damped_sinusoids
    >>> clip = damped_sinusoids(
    ...     np.array([440.0]), np.array([8.0]), np.array([0.5]), np.zeros(1), rate=8000, count=8000
    ... )
    >>> sound = extract(clip, 8000)
    >>> sound.frequencies.round(3).tolist(), sound.dampings.round(3).tolist()
    ([440.0], [8.0])
    """
    clip = np.asarray(samples, dtype=float)
    _require_sound(clip)
    strike = strike_sample(clip)
    clip = clip[strike:]
    if len(clip) < SHORTEST_SAMPLES:
        raise UserError(
            f"the clip ends {len(clip)} samples after its strike, expected {SHORTEST_SAMPLES} at "
            "least; give a longer recording"
        )
    _require_no_steady_tone(clip, rate)
    scale = float(np.abs(clip).max())
    searched = clip[: round(LONGEST_SECONDS * rate)] / scale
    with blas_threads(1):  # many small matrices
        start, fit = _begun(searched, rate, visible)
        _require_modes(fit, len(searched) - start, rate)
        fit = _modes_of(fit, searched[start:])
    return _as_sound(fit, clip[start:], strike + start, rate, scale, modes)


def _require_sound(clip: Array) -> None:
    if clip.ndim != 1:
        raise ValueError(f"samples of shape {clip.shape}, expected one channel")
    if not np.isfinite(clip).all():
        bad = int((~np.isfinite(clip)).sum())
        raise UserError(
            f"the clip has {bad} samples that are not finite numbers; repair or record it again"
        )
    try:
        require_level(float(np.abs(clip).max(initial=0.0)))
    except UserError as error:
        raise UserError(f"the clip {error}") from None


def _require_no_steady_tone(clip: Array, rate: int) -> None:
    """Refuse a tone that is as loud at the end as at the beginning, before it is searched.

    Where it breaks off, it would fill all bands with candidates.
    """
    quarter = len(clip) // 4
    first, last = clip[:quarter], clip[-quarter:]
    if last @ last < np.exp(-1.5 * LEAST_DECAY) * (first @ first):
        return
    power = np.abs(np.fft.rfft(clip * np.hanning(len(clip)))) ** 2
    peak = int(np.argmax(power))
    if power[max(0, peak - 2) : peak + 3].sum() > 0.5 * power.sum():
        raise UserError(_steady(peak * rate / len(clip), len(clip) / rate))


def _steady(hertz: float, seconds: float) -> str:
    return (
        f"the clip does not decay (its tone at {hertz:.5g} Hz does not fade in {seconds:.3g} s), "
        "expected the sound of a strike"
    )


def _begun(clip: Array, rate: int, visible: bool) -> tuple[int, Fit]:
    """The sample from which on the modes ring freely, and their fit from there on.

    A blow lasts some milliseconds, in which modes are still driven, or none. Of a fit from the
    strike on and one from where the modes of the first explain most, that is taken which leaves
    least of the clip, what comes before included.
    """
    energy = np.concatenate([[0.0], np.cumsum(clip**2)])

    def left(start: int, fit: Fit) -> float:
        rest = clip[start:]
        rest = rest - superposed(fit.exponents, fitted_coefficients(fit.exponents, rest), len(rest))
        return float(energy[start] + rest @ rest)

    latest = max(0, min(round(LONGEST_BLOW * rate), len(clip) - SHORTEST_SAMPLES))
    passed = np.searchsorted(energy, np.array(BLOW_SHARES) * energy[-1])
    first = _fitted(clip, rate, visible)
    starts = [int(start) for start in np.unique(np.minimum(passed, latest))]
    start = min(starts, key=lambda each: left(each, first))
    before = left(0, first)
    if left(start, first) > WORTH_IT * before:
        return 0, first
    second = _fitted(clip[start:], rate, visible)
    return (start, second) if left(start, second) < before else (0, first)


def _fitted(clip: Array, rate: int, visible: bool) -> Fit:
    """All damped sinusoids that stand out of a clip."""
    fit = settled(np.zeros(0, complex), clip, 0)
    first = 0.5 * BAND_SAMPLES / min(1.0, len(clip) / rate)
    widths = [first * factor for factor in WIDTH_FACTORS]
    for width in [width for width in widths if width < 0.5 * rate] or [0.5 * rate]:
        is_slow = -fit.exponents.real * rate < BAND_DECAY * 2.0 * width / BAND_SAMPLES
        slow, quick = fit.chosen(is_slow), fit.exponents[~is_slow]
        rest = clip - superposed(slow.exponents, slow.coefficients, len(clip))
        new = candidates(rest, rate, width, f"bands of {width:.0f} Hz", visible)
        # Two sinusoids for one mode would fit a clean clip even better.
        new = new[~_is_beside(new, slow.exponents)]
        quick = quick[~_is_beside(quick, new)]
        fit = settled(np.concatenate([slow.exponents, quick, new]), clip, _SETTLING_STEPS)
    for _ in range(PURSUITS):
        rest = clip - superposed(fit.exponents, fit.coefficients, len(clip))
        new = further(rest, rate)
        new = new[~_is_beside(new, fit.exponents)]
        if not len(new):
            break
        before = len(fit.exponents)
        fit = settled(np.concatenate([fit.exponents, new]), clip, _SETTLING_STEPS)
        if len(fit.exponents) <= before:
            break
    return _final(fit, clip)


def _final(fit: Fit, clip: Array) -> Fit:
    """A fit refined to the end, each mode once."""
    fit = settled(fit.exponents, clip, _FINAL_STEPS)
    return settled(fit.exponents[~_is_drowned(fit)], clip, 0)


def _is_beside(exponents: Complex, others: Complex) -> NDArray[np.bool_]:
    """Which exponents nobody can tell from one of the others."""
    if not len(others):
        return np.zeros(len(exponents), bool)
    distance = np.abs(exponents[:, None] - others).min(axis=1)
    return np.asarray(distance < SAME * np.abs(exponents.real))


def _is_drowned(fit: Fit) -> NDArray[np.bool_]:
    """Which sinusoids lie under the peak of another mode, far below it in amplitude."""
    distance = np.abs(fit.exponents[:, None] - fit.exponents)
    under = distance < UNDER_PEAK * np.abs(fit.exponents.real)
    amplitudes = np.abs(fit.coefficients)
    louder = amplitudes[None, :] * DROWNED > amplitudes[:, None]
    return np.asarray((under & louder).any(axis=1))


def _is_mode(fit: Fit, samples: int) -> NDArray[np.bool_]:
    """Which sinusoids decay and sound for several periods within the clip."""
    decays = -fit.exponents.real * samples > LEAST_DECAY
    return decays & rings(fit.exponents) & _has_periods(fit, samples)


def _modes_of(fit: Fit, clip: Array) -> Fit:
    """The modes of a fit, without what is none but may have held up one beside it."""
    is_mode = _is_mode(fit, len(clip))
    if is_mode.all():
        return fit
    fit = settled(fit.exponents[is_mode], clip, _SETTLING_STEPS)
    return fit.chosen(_is_mode(fit, len(clip)))


def _has_periods(fit: Fit, samples: int) -> NDArray[np.bool_]:
    return fit.exponents.imag * samples > 2.0 * np.pi * FEWEST_PERIODS


def _energies(fit: Fit, samples: int) -> Array:
    """Energy of each sinusoid within the clip."""
    rate = -2.0 * fit.exponents.real
    share = -np.expm1(-rate * samples) / np.where(rate == 0.0, 1.0, rate)
    return np.abs(fit.coefficients) ** 2 * np.where(rate == 0.0, samples, share) / 2.0


def _require_modes(fit: Fit, samples: int, rate: int) -> None:
    """Refuse a clip whose energy is mostly not in modes."""
    energies = _energies(fit, samples)
    modes, whole = _is_mode(fit, samples), _has_periods(fit, samples)
    seconds = samples / rate
    if energies[~whole].sum() > energies[whole].sum():
        lowest = float(fit.exponents[~whole].imag.min() * rate / (2.0 * np.pi))
        raise UserError(
            f"the clip lasts {seconds:.3g} s, which is less than {FEWEST_PERIODS:.0f} periods of "
            f"its lowest mode ({lowest:.3g} Hz); give a longer recording"
        )
    steady = whole & (-fit.exponents.real * samples <= LEAST_DECAY)
    if energies[steady].sum() > energies[modes].sum():
        loudest = np.argmax(np.where(steady, energies, 0.0))
        hertz = float(fit.exponents[loudest].imag * rate / (2.0 * np.pi))
        raise UserError(_steady(hertz, seconds))
    if not modes.any():
        raise UserError(
            "the clip has no modes that stand out of its noise, expected the sound of a strike"
        )


def _as_sound(
    fit: Fit, clip: Array, strike: int, rate: int, scale: float, modes: int | None
) -> ModalSound:
    if modes is not None and modes > len(fit.exponents):
        raise UserError(
            f"{modes} modes asked for, more than the {len(fit.exponents)} that were extracted from "
            "the clip; ask for fewer"
        )
    residual = clip - superposed(fit.exponents, fit.coefficients * scale, len(clip))
    energies = np.abs(fit.coefficients) ** 2 / -fit.exponents.real
    strongest = np.sort(np.argsort(-energies, kind="stable")[:modes])
    chosen, deviations = fit.chosen(strongest), fit.deviations(len(clip))[strongest] * rate
    explained = clip - superposed(chosen.exponents, chosen.coefficients * scale, len(clip))
    evidence = {
        "strike_seconds": strike / rate,
        "order": len(fit.exponents),
        "explained": 1.0 - float(explained @ explained) / float(clip @ clip),
        "explained_by_all": 1.0 - float(residual @ residual) / float(clip @ clip),
        "frequency_deviations_hz": (deviations.imag / (2.0 * np.pi)).tolist(),
        "damping_deviations_per_second": deviations.real.tolist(),
    }
    return ModalSound(
        frequencies=chosen.exponents.imag * rate / (2.0 * np.pi),
        dampings=-chosen.exponents.real * rate,
        amplitudes=np.abs(chosen.coefficients) * scale,
        phases=np.angle(1j * chosen.coefficients),
        residual=residual,
        rate=rate,
        evidence=evidence,
    )
