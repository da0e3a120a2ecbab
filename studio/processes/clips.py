"""Modes of clips, and their parts as sounds."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from sound.clips.extraction import remarks
from sound.clips.files import extract_file
from sound.clips.noise import noise_part
from sound.clips.wav import as_wav, read_wav

SPECTRUM_POINTS = 2000
"""Points of a drawn spectrum; each shows the loudest of its part."""
LOWEST_HERTZ, FLOOR_DECIBELS = 20.0, -100.0
"""Lowest frequency [Hz] and lowest level [dB] of drawn spectra."""
TOLD_SECONDS = 0.25
"""Least time between two pieces of news of an extraction."""


@dataclass(frozen=True)
class ClipFile:
    """A clip by the name of its file, and whether it may be clipped."""

    path: str
    allow_clipped: bool = False


class ClipsBench:
    """What the process for clips does."""

    def listen(
        self, tell: Callable[[tuple[str, float | None]], None], clip: ClipFile
    ) -> dict[str, Any]:
        """Modes of a clip, and what is to be said of them, as the page gets it.

        `tell` receives what is being done, and the share of it that is done or None.
        """
        due = 0.0

        def pass_on(doing: str, share: float | None) -> None:
            nonlocal due
            if share is None or time.monotonic() >= due:
                due = time.monotonic() + TOLD_SECONDS
                tell((doing, share))

        sound = extract_file(clip.path, allow_clipped=clip.allow_clipped, progress=pass_on)
        modes = zip(sound.frequencies, sound.dampings, sound.amplitudes)
        return {
            "seconds": len(sound.residual) / sound.rate,
            "rate_hz": sound.rate,
            "explained": float(sound.evidence["explained"]),
            "says": remarks(sound.evidence),
            "modes": [
                {"hertz": float(f), "damping_per_second": float(d), "amplitude": float(a)}
                for f, d, a in modes
            ],
        }

    def part(self, clip: ClipFile, part: str) -> bytes:
        """The clip itself (`sound`), its `modes`, its `rest` or the `noise` of that, as WAV."""
        if part == "sound":
            return as_wav(*read_wav(clip.path, clip.allow_clipped))
        sound = extract_file(clip.path, allow_clipped=clip.allow_clipped)
        if part == "modes":
            return as_wav(sound.modal_part(), sound.rate)
        rest = sound.residual
        return as_wav(rest if part == "rest" else noise_part(rest, sound.rate)[0], sound.rate)

    def spectrum(self, clip: ClipFile) -> dict[str, list[float]]:
        """Levels of a clip's spectrum below its loudest, by ascending frequencies."""
        samples, rate = read_wav(clip.path, clip.allow_clipped)
        magnitudes = np.abs(np.fft.rfft(samples))
        hertz = np.fft.rfftfreq(len(samples), 1.0 / rate)
        edges = np.geomspace(LOWEST_HERTZ, rate / 2.0, SPECTRUM_POINTS + 1)
        first = np.unique(np.searchsorted(hertz, edges))
        first = first[first < len(hertz)]
        loudest = np.maximum.reduceat(magnitudes, first)
        # Where the loudest one stands, so that narrow peaks are drawn at their frequency.
        ends = np.append(first[1:], len(hertz))
        at = [a + int(np.argmax(magnitudes[a:b])) for a, b in zip(first, ends)]
        levels = 20.0 * np.log10(np.maximum(loudest / magnitudes.max(), 1e-10))
        return {
            "hertz": hertz[at].tolist(),
            "decibels": np.maximum(levels, FLOOR_DECIBELS).tolist(),
        }
