"""The sound of strikes as it is written: how long it is, how loud, and how it ends."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array
from solver.response.response import SAMPLE_RATE_HERTZ
from sound.bounds import MOST_SAMPLES, require_length
from sound.clips.wav import PEAK
from sound.levels import (
    DECAY_NEPERS,
    END_DBFS,
    END_SECONDS,
    FULL,
    SoundLevel,
    decibels,
    end_dbfs,
    faded,
    limited,
    relative_loudness,
)
from sound.rendering.listening import Listening
from sound.rendering.render import Hit, rendered_parts
from sound.rendering.solid import SoundingSolid

MARGIN = 0.1
"""Level of the end over that of a sound before it is made as loud as it is written; where peaks are
attenuated, the end is louder beside them."""
LONGEST_SECONDS = 30.0
"""Greatest time after the last strike [s] of a sound whose length is not given."""


@dataclass(frozen=True)
class LevelOptions:
    """What is done to the level of a sound.

    `raw` samples stay as they are computed.  Otherwise those of a design's modes, which are as loud
    as its clips, are kept within full scale: sounds with strikes of more than 1 N s are scaled, at
    most as if the strongest had 1 N s, and peaks that are still beyond are attenuated, see
    `sound.levels.limited`.  Those of other modes are scaled to `sound.clips.wav.PEAK`.  With
    `normalise` either are scaled to full scale.  The end has a fade of `fade_seconds`; by default
    as long as `sound.levels.faded` says, and none if raw.
    """

    raw: bool = False
    normalise: bool = False
    fade_seconds: float | None = None


@dataclass(frozen=True)
class RenderedSound:
    """Modes (s,) and noise (s,) of strikes, which add up to the sound, at a rate [Hz]."""

    modes: Array
    noise: Array
    rate: int
    level: SoundLevel
    scale: float
    """float: factor by which all samples were scaled."""
    limited_decibels: float
    """dB: greatest attenuation of single peaks, 0 for none."""
    cut_off: bool
    """bool: whether it still rings at the greatest length of a sound whose length is not given."""

    @property
    def samples(self) -> Array:
        """The sound (s,)."""
        return self.modes + self.noise

    def relative_loudness(self, seconds: float) -> float:
        """Loudness [LUFS] of the first seconds, as that of clips, see `ClipLoudness`."""
        return relative_loudness(self.samples[: round(seconds * self.rate)], self.rate)


def render_sound(
    solid: SoundingSolid,
    hits: Sequence[Hit],
    seconds: float | None = None,
    rate: int = SAMPLE_RATE_HERTZ,
    contact_seconds: float = 0.0,
    listening: Listening | None = None,
    residual: bool = True,
    options: LevelOptions | None = None,
) -> RenderedSound:
    """The sound of one strike or many, as it is written; `rendered_parts` has the parameters.

    Without a length it goes on until it stays below -60 dBFS and 60 dB below its peak, at most for
    `LONGEST_SECONDS` after the last strike.  Raises UserError if that are too many samples.
    """
    options = options or LevelOptions()

    def parts(length: float) -> tuple[Array, Array]:
        require_length(length, rate)
        return rendered_parts(solid, hits, length, rate, contact_seconds, listening, residual)

    if seconds is None:
        modes, noise = _decayed(parts, max(hit.seconds for hit in hits), solid, rate)
    else:
        modes, noise = parts(seconds)
    has_level = listening is not None and not options.normalise
    peak = float(np.maximum(np.abs(modes + noise), np.abs(modes)).max(initial=0.0))
    strongest = max(float(np.linalg.norm(hit.impulse)) for hit in hits)
    scale = _scale(peak, strongest, options, has_level)
    gains = np.ones(len(modes))
    if not options.raw:
        like = listening.clip_seconds(hits[0].position) if listening and len(hits) == 1 else None
        # Modes may be written by themselves, just as loud.
        factor, gains = limited(scale * (modes + noise), rate, like, scale * modes)
        scale *= factor
    modes, noise, cut_off = scale * gains * modes, scale * gains * noise, False
    if seconds is None:
        stop = _end(modes + noise, rate, 1.0 if has_level else np.inf)
        cut_off = stop > len(modes)
        modes, noise = modes[:stop], noise[:stop]
    end = end_dbfs(modes + noise, rate)
    fade = 0.0 if options.raw and options.fade_seconds is None else options.fade_seconds
    samples, fade = faded(modes + noise, rate, fade)
    if fade:
        modes, noise = (faded(each, rate, fade)[0] for each in (modes, noise))
    level = SoundLevel.of(samples, rate, end, fade)
    attenuation = decibels(1.0 / float(gains.min(initial=1.0)))
    return RenderedSound(modes, noise, rate, level, scale, attenuation, cut_off)


def _decayed(
    parts: Callable[[float], tuple[Array, Array]], last: float, solid: SoundingSolid, rate: int
) -> tuple[Array, Array]:
    """Modes and noise until they have decayed, or until `LONGEST_SECONDS` after the `last` strike.

    `parts` makes those of a length [s].
    """
    length = last + ringing_seconds(solid) + END_SECONDS
    longest = max(length, min(last + LONGEST_SECONDS, MOST_SAMPLES / rate))
    while True:
        modes, noise = parts(length)
        sound = modes + noise
        if _end(sound, rate, 1.0, MARGIN) <= len(sound) or length >= longest:
            return modes, noise
        length = min(longest, 2.0 * length - last)


def _end(samples: Array, rate: int, full: float, share: float = 1.0) -> int:
    """Number of samples up to the end of a sound, more than there are if they do not reach it.

    From `END_SECONDS` before the end on, magnitudes are below -60 dB over `full`, or over the
    sound's peak if that is less, times a share.
    """
    magnitudes = np.abs(samples)
    least = share * 10.0 ** (END_DBFS / 20.0) * min(full, float(magnitudes.max(initial=0.0)))
    loud = np.flatnonzero((magnitudes >= least) & (magnitudes > 0.0))
    return (int(loud[-1]) + 1 if len(loud) else 0) + round(END_SECONDS * rate)


def ringing_seconds(solid: SoundingSolid) -> float:
    """Time until the slowest mode has decayed by 60 dB and `MARGIN` [s], or `LONGEST_SECONDS`."""
    slowest, decay = float(solid.dampings.min()), DECAY_NEPERS - np.log(MARGIN)
    return min(LONGEST_SECONDS, decay / slowest) if slowest > 0.0 else LONGEST_SECONDS


def _scale(peak: float, strongest: float, options: LevelOptions, has_level: bool) -> float:
    """Factor on a sound of a peak, whose strongest strike is of so many N s."""
    if options.raw or peak == 0.0:
        return 1.0
    if options.normalise:
        return FULL / peak
    if has_level:
        return min(1.0, max(FULL / peak, 1.0 / strongest))
    return PEAK / peak
