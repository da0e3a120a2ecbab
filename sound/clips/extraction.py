"""Modes of a contact sound: frequencies, dampings and amplitudes from a clip of one strike.

Ren, Yeh and Lin (2013), whom the paper follows, fit peaks of spectrograms.  Here all damped
sinusoids that stand out of the noise are fitted to the whole clip, see `sound.clips.mode_search`,
from the beginning of the free vibration on, see `sound.clips.free_vibration`.

Two modes are resolved if their frequencies differ by the half-power bandwidth d / pi where the
signal is 20 dB above the noise, by two thirds of it at 40 dB.  Errors of resolved modes are those
that the noise makes inevitable.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.command_line.counts import counted
from carillon.command_line.progress import Watch, watched
from carillon.errors import UserError
from carillon.notebook.card import hertz, html_or_text
from carillon.processes.threads import blas_threads
from sound.bounds import LONGEST_COMPARED, require_level
from sound.clips.candidates import LEAST_DECAY
from sound.clips.extent import ending, second_strike, strike_sample
from sound.clips.free_vibration import SHORTEST_SAMPLES, free_modes, is_clipped, restored
from sound.clips.glide import glide
from sound.clips.mode_search import FEWEST_PERIODS, has_periods, is_mode
from sound.clips.significance import Fit
from sound.levels import relative_loudness
from sound.synthesis.sinusoids import damped_sinusoids, superposed

LONGEST_SECONDS = 6.0
"""Length of the part after the strike that is searched for modes [s]."""
Progress = Callable[[str, float | None], None]
"""Receives what `extract` does and which share of that is done; None if that is not known."""
FITTING = "fitting what was found"
"""What `extract` does after each search of bands."""
MOSTLY_MODES = 0.8
"""Least share of a clip's energy in its modes without a remark."""


@dataclass(frozen=True)
class ModalSound:
    """A contact sound as damped sinusoids and a rest.

    s(t) = sum_k a_k exp(-d_k t) sin(2 pi f_k t + theta_k) + residual, t = 0 at the strike.
    """

    frequencies: Array
    """(n,) [Hz]: ascending."""
    dampings: Array
    """(n,) [1/s]: d."""
    amplitudes: Array
    """(n,) amplitudes at the strike, in units of the samples."""
    phases: Array
    """(n,) [rad]: theta."""
    residual: Array
    """(s,) the clip from the beginning of free vibration to a second strike or a fade-out, minus
    all modes, including those that are not kept."""
    rate: int
    """int [Hz]: samples per second."""
    evidence: dict[str, Any]
    """dict: details of the search and of its accuracy; plain values."""

    def __repr__(self) -> str:
        modes = self.frequencies
        between = f", {hertz(modes[0])} to {hertz(modes[-1])} Hz" if len(modes) else ""
        return f"<ModalSound: {len(modes)} modes{between}>"

    def _repr_html_(self) -> str:
        from sound.clips.sound_html import modal_sound_html

        return html_or_text(self, lambda: modal_sound_html(self))

    @property
    def energies(self) -> Array:
        """Energy (n,) of each mode, its squared samples summed over all time."""
        return np.asarray(self.amplitudes**2 * self.rate / (4.0 * self.dampings))

    def modal_part(self) -> Array:
        """Samples (s,) of the modes alone, as many as the residual has."""
        values = (self.frequencies, self.dampings, self.amplitudes, self.phases)
        return damped_sinusoids(*values, self.rate, len(self.residual))


def extract(
    samples: Array,
    rate: int,
    modes: int | None = None,
    visible: bool = False,
    progress: Progress | None = None,
) -> ModalSound:
    """Modes of the contact sound that a clip holds; of several strikes, of the first.

    Parameters
    ----------
    samples : (s,)
        Samples of one channel.
    rate : int [Hz]
        Samples per second.
    modes : int or None
        Number of modes to keep, those with most energy; all that are found if None.
    visible : bool
        Whether progress is shown.
    progress
        Called with what is done, such as "bands of 98 Hz", and with the share of it that is done.

    Raises
    ------
    UserError
        If the clip is silent or far beyond full scale, has no modes or fewer than asked for, does
        not decay, or is shorter than three periods of its lowest mode.

    Examples
    --------
    >>> from sound.synthesis.sinusoids import damped_sinusoids
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
    second = second_strike(clip[strike:], rate)
    compared = clip[strike:][: round(LONGEST_COMPARED * rate)]
    clip = clip[strike:][:second]
    clip = clip[: ending(clip, rate)].copy()
    if len(clip) < SHORTEST_SAMPLES:
        raise UserError(
            f"the clip ends or falls silent {counted(len(clip), 'sample')} after its strike, "
            f"expected {SHORTEST_SAMPLES} at least; give a longer recording"
        )
    _require_no_steady_tone(clip, rate)
    bend = glide(clip, rate)
    scale = float(np.abs(clip).max())
    searched = clip[: round(LONGEST_SECONDS * rate)] / scale
    clipped = is_clipped(clip)[: len(searched)]
    with blas_threads(1), watched(_watch(progress)):  # many small matrices
        if clipped.any():
            free, searched = restored(searched, clipped, rate, visible)
            clip[: len(searched)] = searched * scale
        else:
            free = free_modes(searched, rate, visible)
    start = free.start
    _require_modes(free.whole, len(searched) - start, rate)
    sound = _as_sound(free.modes, clip[start:], rate, scale, modes)
    sound.evidence.update(
        strike_seconds=(strike + start) / rate,
        blow_seconds=start / rate,
        blow_share=float(clip[:start] @ clip[:start]) / float(clip @ clip),
        clipped_samples=int(clipped.sum()),
        end_seconds=(strike + len(clip)) / rate,
        second_strike_seconds=None if second is None else (strike + second) / rate,
        glide=None if bend is None else asdict(bend),
        loudness_lufs=relative_loudness(compared, rate),
        loudness_seconds=len(compared) / rate,
    )
    return sound


def _watch(progress: Progress | None) -> Watch | None:
    if progress is None:
        return None

    def tell(label: str, done: int, total: int | None) -> None:
        if total is None or done >= total:
            progress(FITTING, None)
        else:
            progress(label, done / total)

    return tell


def _require_sound(clip: Array) -> None:
    if clip.ndim != 1:
        raise ValueError(f"samples of shape {clip.shape}, expected one channel")
    if not np.isfinite(clip).all():
        raise UserError(
            "the clip has samples that are not finite numbers; repair or record it again"
        )
    try:
        require_level(float(np.abs(clip).max(initial=0.0)))
    except UserError as error:
        raise UserError(f"the clip {error}") from None


def _require_no_steady_tone(clip: Array, rate: int) -> None:
    """Refuse a tone that is as loud at the end as at the beginning, before the search.

    Its end would fill all bands with candidates.
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


def _energies(fit: Fit, samples: int) -> Array:
    rate = -2.0 * fit.exponents.real
    share = -np.expm1(-rate * samples) / np.where(rate == 0.0, 1.0, rate)
    return np.abs(fit.coefficients) ** 2 * np.where(rate == 0.0, samples, share) / 2.0


def _require_modes(fit: Fit, samples: int, rate: int) -> None:
    energies = _energies(fit, samples)
    modes, whole = is_mode(fit, samples), has_periods(fit, samples)
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


def _as_sound(fit: Fit, clip: Array, rate: int, scale: float, modes: int | None) -> ModalSound:
    if modes is not None and modes > len(fit.exponents):
        raise UserError(
            f"{counted(modes, 'mode')} asked for, more than the {len(fit.exponents)} that "
            "were extracted from the clip; ask for fewer"
        )
    residual = clip - superposed(fit.exponents, fit.coefficients * scale, len(clip))
    energies = np.abs(fit.coefficients) ** 2 / -fit.exponents.real
    strongest = np.sort(np.argsort(-energies, kind="stable")[:modes])
    chosen, deviations = fit.chosen(strongest), fit.deviations(len(clip))[strongest] * rate
    explained = clip - superposed(chosen.exponents, chosen.coefficients * scale, len(clip))
    evidence = {
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


def remarks(evidence: Mapping[str, Any]) -> list[str]:
    """Remarks, without full stops, on what is unusual in the evidence of a `ModalSound`."""
    sentences = []
    if evidence["explained"] < MOSTLY_MODES:
        sentences.append(
            f"{1.0 - evidence['explained']:.0%} of its energy is noise, or tones that do not fade "
            "evenly, which no material has"
        )
    return [*sentences, *oddities(evidence)]


def oddities(evidence: Mapping[str, Any]) -> list[str]:
    """The remarks on what else than free vibration is in the evidence of a `ModalSound`."""
    sentences = []
    if evidence["clipped_samples"]:
        sentences.append(f"{counted(evidence['clipped_samples'], 'sample')} at full scale left out")
    if evidence["second_strike_seconds"] is not None:
        sentences.append(
            f"there is another strike at {evidence['second_strike_seconds']:.2f} s, left out"
        )
    if evidence["glide"] is not None:
        bend = evidence["glide"]
        sentences.append(
            f"its loudest tone glides from {bend['cents']:+.0f} cents to {bend['hertz']:.1f} Hz "
            f"within {bend['seconds']:.2f} s, which no material does"
        )
    return sentences
