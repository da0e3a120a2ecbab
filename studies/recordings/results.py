"""Results of one recording, read from the files that `sound extract` writes."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import soundfile
from numpy.typing import NDArray

from sound.clips.wav import read_wav
from studies.base.conditions import Record
from studies.base.results import Results
from studies.base.table import Row
from studies.recordings.measurement import MODES, RESIDUAL, RUN
from studies.recordings.peaks import LOWEST_HERTZ, Peaks, strong_peaks
from studies.recordings.recordings import (
    EXTRACTED,
    PACKAGES,
    START,
    RecordedStrike,
    recordings,
)

Array = NDArray[np.float64]

_LEAST = 1e-20
"""Share of the energy below which nothing is left."""


@dataclass(frozen=True)
class RecordingResults(Results):
    """Results of a recording, below the folder of all of them."""

    name: str

    @cached_property
    def recording(self) -> RecordedStrike:
        """What was struck."""
        return recordings()[self.name]

    @property
    def clip(self) -> Path:
        """The recording's file."""
        return self.recording.path(self.folder / PACKAGES)

    def file(self, name: str) -> Path:
        """A file that was written for it."""
        return self.folder / self.name / EXTRACTED / name

    @cached_property
    def run(self) -> dict[str, Any]:
        """How the extraction went."""
        return self.read_json(self.file(RUN).relative_to(self.folder))

    @property
    def refused(self) -> bool:
        """Whether the clip was refused."""
        return bool(self.run["said"])

    @property
    def absent(self) -> tuple[str, ...]:
        """Tables that there is nothing for."""
        return ("modes", "missed") if self.refused else ()

    @property
    def origins(self) -> dict[str, Record]:
        """Provenance of what was extracted."""
        return {f"{self.name}/{EXTRACTED}/{RUN}": self.run["provenance"]}

    @cached_property
    def found(self) -> dict[str, Any]:
        """What `extract` wrote of the modes."""
        return self.read_json(self.file(MODES).relative_to(self.folder))

    @property
    def frequencies(self) -> Array:
        """Frequencies (n,) [Hz] of the modes; none of a clip that was refused."""
        return np.array([] if self.refused else self.found["frequencies_hz"], dtype=float)

    @cached_property
    def rate(self) -> int:
        """Samples of the recording per second [Hz]."""
        return int(soundfile.info(self.clip).samplerate)

    @property
    def seconds(self) -> float:
        """Length of the recording."""
        return len(self.whole) / self.rate

    @property
    def begins(self) -> int:
        """Sample from which on the modes were fitted; the first of a clip that was refused."""
        if self.refused:
            return 0
        return round(self.found["clips"][0]["strike_seconds"] * self.rate)

    @cached_property
    def residual(self) -> Array:
        """What is left (s,) from there on without the modes."""
        return soundfile.read(self.file(RESIDUAL))[0]

    @cached_property
    def whole(self) -> Array:
        """The one channel (s,) that is searched; the mean of all of a clip that was refused."""
        if self.refused:
            return np.asarray(soundfile.read(self.clip, always_2d=True)[0].mean(axis=1))
        return read_wav(self.clip, allow_clipped=True)[0]

    @property
    def searched(self) -> Array:
        """The clip (s,) from where the modes were fitted on, up to a second strike."""
        clip = self.whole[self.begins :]
        return clip if self.refused else clip[: len(self.residual)]

    @property
    def left(self) -> float:
        """Share of the energy of `searched` that no mode explains."""
        left, clip = self.residual, self.searched
        return float(left @ left) / max(float(clip @ clip), _LEAST)

    @property
    def left_to_hear(self) -> float:
        """The same from `LOWEST_HERTZ` on: rumble below is loud in some recordings, and unheard."""
        heard = np.fft.rfftfreq(len(self.searched), 1.0 / self.rate) >= LOWEST_HERTZ
        left, all_of_it = (
            float((np.abs(np.fft.rfft(part))[heard] ** 2).sum())
            for part in (self.residual, self.searched)
        )
        return left / max(all_of_it, _LEAST)

    @property
    def before(self) -> float:
        """Share of the whole clip's energy that lies before."""
        early = self.whole[: self.begins]
        return float(early @ early / (self.whole @ self.whole))

    @cached_property
    def peaks(self) -> Peaks:
        """Strong peaks of the clip."""
        return strong_peaks(self.searched, self.rate)

    @cached_property
    def missed(self) -> NDArray[np.bool_]:
        """Which of them no mode accounts for."""
        return self.peaks.missed(self.frequencies)

    def summary(self) -> Row:
        """What the study tells of it; a refused clip has no modes."""
        recording, cpu = self.recording, self.run["cpu_seconds"]
        row = {
            "name": recording.name,
            "title": recording.title,
            "kind": recording.kind,
            "split": recording.split,
            "tonal": "yes" if recording.tonal else "no",
            "seconds": self.seconds,
            "cpu": cpu,
            "said": self.run["said"],
        }
        if self.refused:
            return row
        return row | {
            "modes": len(self.frequencies),
            "explained": 1.0 - self.left,
            "decibels": -10.0 * np.log10(max(self.left, _LEAST)),
            "decibels_heard": -10.0 * np.log10(max(self.left_to_hear, _LEAST)),
            "before": self.before,
            "peaks": len(self.missed),
            "missed": int(self.missed.sum()),
            "cpu_rate": max(0.0, cpu - self.read_json(START)["cpu_seconds"]) / self.seconds,
        }
