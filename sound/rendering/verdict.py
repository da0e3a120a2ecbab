"""Verdict on a design: whether it sounds like its clips, why not, and what may help."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.command_line.logs import warn_once
from carillon.errors import UserError
from sound.clips.extraction import ModalSound, remarks
from sound.clips.files import extract_file
from sound.clips.noise import noise_part
from sound.design.pitch import cents
from sound.project.design import Design
from sound.rendering.listening import Listening
from sound.rendering.render import Hit, rendered_parts
from sound.rendering.solid import SoundingSolid
from sound.synthesis.spectral_distance import log_spectral_distance

LIKE, NEAR, CANNOT = "like", "near", "cannot"
LIKE_CENTS, LIKE_DECIBELS, LIKE_RATIO = 30.0, 12.0, 1.5
"""Median distance of the partials [cents], distance of the sounds [dB], and ratio of their times of
decay, up to which a design sounds like its clip."""
NEARER_DECIBELS = 6.0
"""Distance [dB] by which a design that is near its clip is nearer than silence."""
LOUD_DECIBELS = 12.0
"""Error of a partial's level [dB] that is told."""
GAIN = 0.05
"""Share of the cost that two further checks take off a search that gets on."""
FAR_CENTS, FAR_SHARE = 50.0, 0.2
"""Distance of a partial [cents] that is told, and share of such partials in the loudness from which
on a design is not like its clip."""


@dataclass(frozen=True)
class Likeness:
    """How near a design comes to one clip.

    `distance_db` and `silence_db` are distances of the design and of silence from the clip, see
    `log_spectral_distance`; `decay_ratio` is the time in which the design dies away over the
    clip's.
    """

    target: str
    distance_db: float
    silence_db: float
    decay_ratio: float


@dataclass(frozen=True)
class DesignVerdict:
    """Whether a design sounds like its clips: `word` is like, near or cannot.

    `median_cents` is the median distance of the partials that count, `likeness` how near each clip
    is. `reason` and `advice` are sentences without a full stop, empty of a design that is like.
    """

    word: str
    median_cents: float
    likeness: tuple[Likeness, ...]
    reason: str
    advice: str

    def sentence(self) -> str:
        """The verdict in words.

        Examples
        --------
        >>> verdict = DesignVerdict(NEAR, 40.0, (), "the partial at 440 Hz is low", "search on")
        >>> verdict.sentence()
        'near the clip, not like it: the partial at 440 Hz is low; search on'
        """
        begin = {
            LIKE: "like the clip",
            NEAR: "near the clip, not like it",
            CANNOT: "not like the clip",
        }[self.word]
        rest = "; ".join(part for part in (self.reason, self.advice) if part)
        return f"{begin}: {rest}" if rest else begin

    def as_dict(self) -> dict[str, Any]:
        """Plain values, as a design's evidence keeps them."""
        return {**asdict(self), "sentence": self.sentence()}


def judged(design: Design, clips: Sequence[ModalSound]) -> DesignVerdict:
    """Verdict on a design, by the clips of its targets, one each."""
    solid = SoundingSolid.of_design(design)
    heard = Listening.of_design(design, solid)
    likeness = []
    for strike, clip in zip(design.strikes, clips, strict=True):
        target = clip.modal_part() + clip.residual
        hit = Hit(0.0, strike.position, strike.inward)
        parts = rendered_parts(solid, [hit], len(target) / clip.rate, clip.rate, 0.0, heard)
        sound = parts[0] + parts[1]
        level = np.sqrt((target @ target) / max(float(sound @ sound), 1e-300))
        likeness.append(
            Likeness(
                strike.name,
                log_spectral_distance(level * sound, target, clip.rate),
                log_spectral_distance(np.zeros(1), target, clip.rate),
                decay_seconds(sound, clip.rate) / decay_seconds(target, clip.rate),
            )
        )
    which = design.targets.sounding
    off = cents(design.frequencies, design.targets.frequencies)[which]
    median = float(np.median(np.abs(off)))
    far = design.targets.shares[which][np.abs(off) > FAR_CENTS].sum()
    word = _word(median, float(far), likeness)
    reason, advice = ("", "") if word == LIKE else _reason(design, clips, solid, off, likeness)
    rings = _rings(likeness)
    if rings and rings != reason:
        reason += f", and {rings}"
    if word != LIKE:
        unusual = [each for clip in clips if clip.evidence for each in remarks(clip.evidence)]
        reason += "".join(f"; of the clip: {each}" for each in dict.fromkeys(unusual))
    return DesignVerdict(word, median, tuple(likeness), reason, advice)


def with_verdict(design: Design) -> Design:
    """A design with a verdict in its evidence; without one, and a warning, if it cannot be had."""
    try:
        verdict = judged(design, clips_of(design))
    except (UserError, ValueError, LookupError, ArithmeticError) as error:
        # As where a clip is not there any more: the design is.
        warn_once(f"no verdict on the design: {error}")
        return design
    return replace(design, evidence={**design.evidence, "verdict": verdict.as_dict()})


def clips_of(design: Design) -> list[ModalSound]:
    """The clips that a design was made for, as they were searched.

    Raises UserError if one is not there any more.
    """
    return [
        extract_file(each["clip"], each.get("modes"), False, each.get("allow_clipped", False))
        for each in design.settings["targets"]
    ]


def decay_seconds(sound: Array, rate: int) -> float:
    """Time [s] in which a sound falls by 60 dB, from the fall of what is left of its energy.

    By the slope between -3 and -25 dB (Schroeder's integration), or as far as the sound goes.

    Examples
    --------
    >>> t = np.arange(44100) / 44100
    >>> round(decay_seconds(np.exp(-6.9 * t) * np.sin(2e3 * t), 44100), 2)
    1.0
    """
    left = np.cumsum((sound**2)[::-1])[::-1]
    if not len(left) or left[0] <= 0.0:
        return 0.0
    level = 10.0 * np.log10(np.maximum(left / left[0], 1e-12))
    inside = np.flatnonzero((level <= -3.0) & (level >= -25.0))
    if len(inside) < 2:
        return len(sound) / rate
    slope = np.polyfit(inside / rate, level[inside], 1)[0]
    return float(-60.0 / slope)


def _word(median: float, far: float, likeness: Sequence[Likeness]) -> str:
    if any(each.distance_db > each.silence_db - NEARER_DECIBELS for each in likeness):
        return CANNOT
    alike = all(
        each.distance_db <= LIKE_DECIBELS and _ratio(each.decay_ratio) <= LIKE_RATIO
        for each in likeness
    )
    return LIKE if alike and median <= LIKE_CENTS and far < FAR_SHARE else NEAR


def _ratio(value: float) -> float:
    return max(value, 1.0 / value) if value > 0.0 else np.inf


def _reason(
    design: Design,
    clips: Sequence[ModalSound],
    solid: SoundingSolid,
    off: Array,
    likeness: Sequence[Likeness],
) -> tuple[str, str]:
    """What stands most between a design and its clips, and one suggestion."""
    targets = design.targets
    which, shares = targets.sounding, targets.shares[targets.sounding]
    far = np.abs(off) > FAR_CENTS
    missing = targets.left_out
    if missing is not None and targets.left_out_share > float(shares[far].sum()):
        hertz = ", ".join(f"{each:.0f}" for each in missing)
        return (
            f"no mode of the solid can have the clip's partials at {hertz} Hz",
            "take a solid with more modes below them: a longer, larger or thinner one",
        )
    if far.any():
        worst = int(np.argmax(np.where(far, shares, -1.0)))
        partial = f"{targets.frequencies[which][worst]:.0f} Hz"
        side = "high" if off[worst] > 0.0 else "low"
        count = f"{int(far.sum())} of {len(off)} partials are more than {FAR_CENTS:.0f} cents off"
        advice = "search on, the cost still falls"
        if not _falls(design):
            advice = "take another solid, or another point"
            if far.sum() <= 0.5 * len(far):
                listed = ", ".join(f"{each:.0f}" for each in targets.frequencies[which][far])
                advice = f"leave these out (without: [{listed}])"
        return f"{count}, that at {partial} {abs(off[worst]):.0f} cents too {side}", advice
    noisy = [_noise_share(clip) for clip in clips]
    if max(noisy) > 0.5:
        return (
            f"{max(noisy):.0%} of the clip's energy is noise or its attack, which no material has",
            "take a clip that rings",
        )
    positions = np.array([strike.position for strike in design.strikes])
    inward = np.array([strike.inward for strike in design.strikes])
    levels = solid.amplitudes(positions, inward)
    own = 20.0 * np.log10(np.maximum(levels / levels.max(axis=1, keepdims=True), 1e-9))
    aims = targets.amplitudes / targets.amplitudes.max(axis=1, keepdims=True)
    wrong = np.where(aims > 0.0, own - 20.0 * np.log10(np.maximum(aims, 1e-9)), 0.0)
    point, mode = divmod(int(np.argmax(wrong)), wrong.shape[1])
    if wrong[point, mode] > LOUD_DECIBELS:
        return (
            f"the mode at {solid.frequencies[mode]:.0f} Hz is {wrong[point, mode]:.0f} dB too loud "
            f"where {design.strikes[point].name} is struck",
            "strike another point, where it moves less",
        )
    rings = _rings(likeness)
    if rings:
        return rings, _advice_of_decay(design)
    return "the balance of its partials is another one", "strike another point"


def _rings(likeness: Sequence[Likeness]) -> str:
    """How much longer or shorter a design rings than its clips; empty if it does not."""
    ratio = max((each.decay_ratio for each in likeness), key=_ratio)
    if _ratio(ratio) <= LIKE_RATIO:
        return ""
    return (
        f"it rings {_ratio(ratio):.1f} times {'longer' if ratio > 1.0 else 'shorter'} than the clip"
    )


def _advice_of_decay(design: Design) -> str:
    if design.settings.get("damping", {}).get("source", "clips") == "material":
        return "take the dampings of the clips (damping: {source: clips})"
    # Each partial dies away as the clip's: another balance of them makes the difference.
    return "strike another point"


def _falls(design: Design) -> bool:
    """Whether the last checks of a search lowered the cost."""
    costs = np.minimum.accumulate([each["cost"] for each in design.evidence.get("checks", [])])
    return len(costs) < 3 or bool(costs[-1] < (1.0 - GAIN) * costs[-3])


def _noise_share(clip: ModalSound) -> float:
    """Share of noise in a clip's energy."""
    noise = noise_part(clip.residual, clip.rate)[0]
    whole = float(clip.energies.sum()) + float(clip.residual @ clip.residual)
    return float(noise @ noise) / whole
