"""Verdict on a design: whether it sounds like its clips, why not, and what may help."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from carillon.command_line.logs import warn_once
from carillon.errors import UserError
from sound.clips.extraction import ModalSound, oddities, remarks
from sound.clips.files import extract_file
from sound.clips.targets import without_modes
from sound.design.pitch import cents
from sound.project.design import Design
from sound.rendering.likeness import (
    LIKE_CENTS,
    LIKE_DECIBELS,
    LIKE_RATIO,
    NEARER_DECIBELS,
    Likeness,
)
from sound.rendering.listening import Listening
from sound.rendering.solid import SoundingSolid
from sound.rendering.verdict_reason import (
    FAR_CENTS,
    MOSTLY,
    Judged,
    foreign_share,
    reason_of,
    rings,
)

LIKE, NEAR, CANNOT = "like", "near", "cannot"
FAR_SHARE = 0.2
"""Share of the loudness in partials that are `FAR_CENTS` off, from which on a design is not like
its clip."""


@dataclass(frozen=True)
class DesignVerdict:
    """Whether a design sounds like its clips: `word` is like, near or cannot.

    `median_cents` is the median distance of the partials that count, `likeness` how near each clip
    is. `reason` and `advice` are sentences without a full stop, empty of a design that is like;
    `remarks` tell what is unusual of the clips.
    """

    word: str
    median_cents: float
    likeness: tuple[Likeness, ...]
    reason: str
    advice: str
    remarks: tuple[str, ...] = ()

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
        unusual = f"; of the clip: {'; '.join(self.remarks)}" if self.remarks else ""
        return f"{begin}{': ' if rest else ''}{rest}{unusual}"

    def as_dict(self) -> dict[str, Any]:
        """Plain values, as a design's evidence keeps them."""
        return {**asdict(self), "sentence": self.sentence()}


def judged(design: Design, clips: Sequence[ModalSound]) -> DesignVerdict:
    """Verdict on a design, by the clips of its targets, one each."""
    solid = SoundingSolid.of_design(design)
    heard = Listening.of_design(design, solid)
    likeness = []
    for strike, clip in zip(design.strikes, clips, strict=True):
        whole = clip.modal_part() + clip.residual
        where = strike.position, strike.inward
        likeness.append(Likeness.of_strike(strike.name, *where, solid, heard, whole, clip.rate))
    which = design.targets.sounding
    off = cents(design.frequencies, design.targets.frequencies)[which]
    median = float(np.median(np.abs(off)))
    far = float(design.targets.shares[which][np.abs(off) > FAR_CENTS].sum())
    word = _word(median, far, likeness)
    reason, advice = "", ""
    if word != LIKE:
        reason, advice = reason_of(Judged(design, clips, solid, heard, off, likeness))
        other = rings(likeness)
        if other and other != reason:
            reason += f", and {other}"
    # What most of a clip is, is the reason already.
    unusual_of = remarks if word == LIKE or foreign_share(clips) <= MOSTLY else oddities
    unusual = [each for clip in clips if clip.evidence for each in unusual_of(clip.evidence)]
    told = tuple(dict.fromkeys(unusual))
    return DesignVerdict(word, median, tuple(likeness), reason, advice, told)


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
    """The clips that a design was made for, as they were searched, without what was left out.

    Raises UserError if one is not there any more.
    """
    return [
        without_modes(
            extract_file(each["clip"], each.get("modes"), False, each.get("allow_clipped", False)),
            each.get("without") or (),
        )
        for each in design.settings["targets"]
    ]


def _word(median: float, far: float, likeness: Sequence[Likeness]) -> str:
    if any(each.distance_db > each.silence_db - NEARER_DECIBELS for each in likeness):
        return CANNOT
    alike = all(each.distance_db <= LIKE_DECIBELS and each.times <= LIKE_RATIO for each in likeness)
    return LIKE if alike and median <= LIKE_CENTS and far < FAR_SHARE else NEAR
