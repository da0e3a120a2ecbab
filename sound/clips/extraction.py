"""Modes of a contact sound: frequencies, dampings and amplitudes from a clip of one strike.

Ren, Yeh and Lin (2013), whom the paper follows, fit peaks of spectrograms.  Here the clip is cut
into bands, ESPRIT (Roy and Kailath 1989) finds the damped sinusoids of every band, ESTER (Badeau,
David and Richard 2006) their number, and a least-squares fit to the whole clip refines them.  This
is done for narrow bands, which tell slow and close modes apart, and then, on what those leave, for
wide ones, in which modes that die away at once stand out.  What does not stand out of the noise
is dropped, which is why ESTER may be generous.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.errors import UserError
from carillon.progress import track
from carillon.threads import single_threaded_blas
from sound.clips.bands import Band, bands
from sound.clips.damped import (
    damped_sinusoids,
    fitted_coefficients,
    inverse,
    normal_matrix,
    refined,
    superposed,
)
from sound.clips.esprit import esprit
from sound.clips.onset import strike_sample

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

LONGEST_SECONDS = 6.0
"""Time after the strike that is searched for modes."""
SHORTEST_SAMPLES = 256
"""Samples from the strike on without which there is nothing to be searched."""
LOWEST_HERTZ = 20.0
FEWEST_PERIODS = 3.0
"""Periods of a mode that a clip must hold; what has fewer is drift rather than a mode."""
LEAST_DECAY = 0.1
"""Nepers (0.87 dB) by which a mode must decay within the clip; what does not is a steady tone."""
LEAST_QUALITY = 2.0
"""pi f / d of a mode; what dies away within its first period is a knock rather than a mode."""
PROMINENCE = 100.0
"""Energy of a mode over that of the noise under it; at 100 its damping is uncertain by 20 %."""
WIDTH_FACTORS = (1.0, 4.0, 16.0)
"""Widths of bands, one search after the other."""
BAND_SAMPLES = 512
"""Length of a band's signal, from the strike on; narrow bands last longer."""
BAND_DECAY = 5.0
"""Nepers of decay within a band's length from which on a mode is sought again in wider bands."""
_PEAK = 20.0
"""Largest over median power in a band's spectrum below which it is taken for noise."""
_NEIGHBOURHOOD = 100.0
"""Angular frequency on either side of a mode, in dampings, from which its noise is taken."""
_LEAST_LEVEL = 1e-15
"""Variance of noise that is always assumed, relative to the peak: that of 24-bit samples."""
_SETTLING_STEPS, _FINAL_STEPS = 4, 20


@dataclass(frozen=True)
class ModalSound:
    """A contact sound as damped sinusoids and a rest.

    s(t) = sum_k a_k exp(-d_k t) sin(2 pi f_k t + theta_k) + residual, t = 0 at the strike.

    Attributes
    ----------
    frequencies : (n,) [Hz], ascending.
    dampings : (n,) [1/s].
    amplitudes : (n,) at the strike, in units of the samples.
    phases : (n,) [rad].
    residual : (s,) the clip from the strike on minus all modes found, those not asked for included.
    rate : samples per second [Hz].
    evidence : how the modes were found and how sure they are; plain values.
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

    def modal_part(self, count: int | None = None) -> Array:
        """Samples (count,) of the modes alone; as many as the residual has unless told."""
        count = len(self.residual) if count is None else count
        values = (self.frequencies, self.dampings, self.amplitudes, self.phases)
        return damped_sinusoids(*values, self.rate, count)


def extract(
    samples: Array, rate: int, modes: int | None = None, visible: bool = False
) -> ModalSound:
    """Modes of the one contact sound that a clip holds.

    Parameters
    ----------
    samples : (s,) of one channel.
    rate : samples per second [Hz].
    modes : number of modes to keep, those with most energy; all that are found if None.
    visible : show progress.

    Raises
    ------
    UserError
        If the clip is silent, has no modes or fewer than asked for, does not decay, or is shorter
        than three periods of its lowest mode.
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
    scale = float(np.abs(clip).max())
    searched = clip[: round(LONGEST_SECONDS * rate)] / scale
    with single_threaded_blas():  # many small matrices
        found = _found(searched, rate, visible)
    _require_modes(found, len(searched), rate)
    kept = found.chosen(_is_mode(found, len(searched)))
    return _as_sound(kept, clip, strike, rate, scale, modes)


def _require_sound(clip: Array) -> None:
    if clip.ndim != 1:
        raise ValueError(f"samples of shape {clip.shape}, expected one channel")
    if not np.isfinite(clip).all():
        bad = int((~np.isfinite(clip)).sum())
        raise UserError(
            f"the clip has {bad} samples that are not finite numbers; repair or record it again"
        )
    if not clip.any():
        raise UserError("the clip is silent, expected the sound of a strike")


@dataclass(frozen=True)
class _Fit:
    """Damped sinusoids (k,) fitted to a clip: see `sound.clips.damped`, and their significance.

    `prominence` (k,) is what the fit would lose without each, over the level (k,) of the noise
    under it, which is the variance of white noise as strong.
    """

    exponents: Complex
    coefficients: Complex
    prominence: Array
    level: Array

    def chosen(self, which: NDArray[Any]) -> _Fit:
        """Some of them, by mask or numbers."""
        fields = (self.exponents, self.coefficients, self.prominence, self.level)
        return _Fit(*(values[which] for values in fields))


def _found(clip: Array, rate: int, visible: bool) -> _Fit:
    """All damped sinusoids that stand out of a clip."""
    exponents, coefficients = np.zeros(0, complex), np.zeros(0, complex)
    first = 0.5 * BAND_SAMPLES / min(1.0, len(clip) / rate)
    widths = [first * factor for factor in WIDTH_FACTORS]
    for width in [width for width in widths if width < 0.5 * rate] or [0.5 * rate]:
        slow = -exponents.real * rate < BAND_DECAY * 2.0 * width / BAND_SAMPLES
        rest = clip - superposed(exponents[slow], coefficients[slow], len(clip))
        new = _candidates(rest, rate, width, f"bands of {width:.0f} Hz", visible)
        exponents, coefficients = _settled(np.concatenate([exponents, new]), clip, _SETTLING_STEPS)
    exponents, coefficients = _settled(exponents, clip, _FINAL_STEPS)
    rest = clip - superposed(exponents, coefficients, len(clip))
    return _significance(exponents, coefficients, rest)


def _candidates(rest: Array, rate: int, width: float, label: str, visible: bool) -> Complex:
    """Exponents per sample of the clip that ESPRIT finds in any band, none of them growing."""
    count = int(0.5 * rate / width) + 1
    parts = bands(rest, rate, width, BAND_SAMPLES)
    found = [_band_exponents(band, rate) for band in track(parts, label, count, visible=visible)]
    return np.concatenate(found)


def _band_exponents(band: Band, rate: int) -> Complex:
    power = np.abs(np.fft.fft(band.signal)) ** 2
    if len(power) < 16 or power.max() < _PEAK * np.median(power):
        return np.zeros(0, complex)
    exponents = esprit(band.signal) * band.rate / rate
    inside = np.abs(exponents.imag) * rate <= np.pi * band.width
    exponents = exponents[inside] + 2j * np.pi * band.centre / rate
    low, high = 2.0 * np.pi * LOWEST_HERTZ / rate, 0.97 * np.pi
    audible = (exponents.imag > low) & (exponents.imag < high)
    quick = LEAST_QUALITY * -exponents.real > 0.5 * exponents.imag
    grows = exponents.real * len(band.signal) * rate / band.rate > LEAST_DECAY
    return exponents[audible & ~quick & ~grows]


def _settled(exponents: Complex, clip: Array, steps: int) -> tuple[Complex, Complex]:
    """Exponents refined on the whole clip, without those that do not stand out; coefficients."""
    exponents, coefficients = _pruned(exponents, clip)
    exponents, coefficients = refined(exponents, coefficients, clip, steps)
    return _pruned(exponents, clip)


def _pruned(exponents: Complex, clip: Array) -> tuple[Complex, Complex]:
    """Exponents in order of frequency, less those that do not stand out; coefficients.

    Of neighbours that do not, the one that the fit needs least goes first: of two estimates of one
    mode neither is needed while the other is there.
    """
    exponents = exponents[np.argsort(exponents.imag)]
    while True:
        coefficients = fitted_coefficients(exponents, clip)
        rest = clip - superposed(exponents, coefficients, len(clip))
        prominence = _significance(exponents, coefficients, rest).prominence
        beside = np.pad(prominence, 1, constant_values=np.inf)
        least = (prominence <= beside[:-2]) & (prominence <= beside[2:])
        weak = least & (prominence < PROMINENCE)
        if not weak.any():
            return exponents, coefficients
        exponents = exponents[~weak]


def _significance(exponents: Complex, coefficients: Complex, rest: Array) -> _Fit:
    """How much of a clip each damped sinusoid alone explains, over the noise in the rest."""
    count = len(exponents)
    matrix = normal_matrix(exponents, np.ones(count, complex), len(rest), order=1)
    blocks = inverse(matrix).reshape(2, count, 2, count)
    own = np.moveaxis(np.diagonal(blocks, axis1=1, axis2=3), -1, 0)
    parts = np.stack([coefficients.real, coefficients.imag], axis=1)
    gain = np.einsum("ki,kij,kj->k", parts, np.linalg.inv(own), parts)
    level = _level(exponents, rest)
    return _Fit(exponents, coefficients, gain / level, level)


def _level(exponents: Complex, rest: Array) -> Array:
    """Variance (k,) of white noise as strong as the rest where and when each sinusoid sounds.

    It is the median, over frequencies around the sinusoid's, of the rest's correlation with
    sinusoids that die away as fast to the nearest power of 2.
    """
    from scipy.fft import next_fast_len, rfft

    size = next_fast_len(len(rest), real=True)
    n = np.arange(len(rest))
    slowest = 1.0 / len(rest)
    octaves = np.round(np.log2(np.maximum(-exponents.real, slowest) / slowest))
    level = np.empty(len(exponents))
    for octave in np.unique(octaves):
        rate = slowest * 2.0**octave
        window = np.exp(-rate * n)
        power = np.abs(rfft(rest * window, size)) ** 2 / (window @ window)
        reach = round(_NEIGHBOURHOOD * rate / (2.0 * np.pi) * size)
        for k in np.flatnonzero(octaves == octave):
            bin_number = round(exponents[k].imag / (2.0 * np.pi) * size)
            around = power[max(0, bin_number - reach) : bin_number + reach + 1]
            level[k] = np.median(around) / np.log(2.0)
    return np.maximum(level, _LEAST_LEVEL)


def _is_mode(fit: _Fit, samples: int) -> NDArray[np.bool_]:
    """Which sinusoids decay and sound for several periods within the clip."""
    decays = -fit.exponents.real * samples > LEAST_DECAY
    rings = fit.exponents.imag > 2.0 * LEAST_QUALITY * -fit.exponents.real
    return decays & rings & _has_periods(fit, samples)


def _has_periods(fit: _Fit, samples: int) -> NDArray[np.bool_]:
    return fit.exponents.imag * samples > 2.0 * np.pi * FEWEST_PERIODS


def _energies(fit: _Fit, samples: int) -> Array:
    """Energy of each sinusoid within the clip."""
    rate = -2.0 * fit.exponents.real
    share = -np.expm1(-rate * samples) / np.where(rate == 0.0, 1.0, rate)
    return np.abs(fit.coefficients) ** 2 * np.where(rate == 0.0, samples, share) / 2.0


def _require_modes(fit: _Fit, samples: int, rate: int) -> None:
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
        raise UserError(
            f"the clip does not decay (its tone at {hertz:.5g} Hz is steady over {seconds:.3g} s), "
            "expected the sound of a strike"
        )
    if not modes.any():
        raise UserError(
            "the clip has no modes that stand out of its noise, expected the sound of a strike"
        )


def _as_sound(
    fit: _Fit, clip: Array, strike: int, rate: int, scale: float, modes: int | None
) -> ModalSound:
    if modes is not None and modes > len(fit.exponents):
        raise UserError(
            f"{modes} modes asked for, more than the {len(fit.exponents)} that were extracted from "
            "the clip; ask for fewer"
        )
    residual = clip - superposed(fit.exponents, fit.coefficients * scale, len(clip))
    energies = np.abs(fit.coefficients) ** 2 / -fit.exponents.real
    chosen = fit.chosen(np.sort(np.argsort(-energies, kind="stable")[:modes]))
    deviations = _deviations(chosen, len(clip)) * rate
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


def _deviations(fit: _Fit, samples: int) -> Complex:
    """Standard deviations of exponents, real and imaginary, that the noise under each allows."""
    count = len(fit.exponents)
    matrix = normal_matrix(fit.exponents, fit.coefficients, samples)
    variances = np.diag(inverse(matrix)).reshape(2, 2, count)[:, 1]
    deviations = np.sqrt(np.maximum(variances, 0.0) * fit.level)
    return np.asarray(deviations[0] + 1j * deviations[1])
