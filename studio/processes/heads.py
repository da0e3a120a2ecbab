"""Measured heads of a folder, the calibration that asks for comparisons of them, and its sounds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError
from sound.clips.wav import as_wav
from sound.heads.calibration import HeadCalibration, calibration_of, load_calibration
from sound.heads.head_space import HeadSpace, head_files, read_heads
from sound.heads.measured_head import MeasuredHead
from sound.heads.sofa_file import write_sofa
from sound.heads.stimulus import at_ears, direction_of, noise_bursts
from sound.levels import faded
from sound.synthesis.sinusoids import damped_sinusoids

SEED = 1
"""Seed of the pairs of a calibration that begins."""
STRIKE_SECONDS, FADE_SECONDS = 1.5, 0.05
"""Length of a strike, and of the fade at its end."""
PEAK = 0.5
"""Largest magnitude of the two sounds of a pair; 1 is full scale."""
PAIRS = {"A": "pair", "B": "pair", "before": "blend", "after": "blend"}
"""Pairs of sounds that are as loud as they are to each other, by their parts."""


@dataclass(frozen=True)
class StruckModes:
    """A strike at a point of a solid: frequencies [Hz], dampings [1/s] and amplitudes of modes."""

    hertz: Array
    dampings: Array
    amplitudes: Array

    def samples(self, rate: float) -> Array:
        """Samples (s,) of the strike."""
        sine, count = np.zeros(len(self.hertz)), round(STRIKE_SECONDS * rate)
        sound = damped_sinusoids(
            self.hertz, self.dampings, self.amplitudes, sine, round(rate), count
        )
        return faded(sound, round(rate), FADE_SECONDS)[0]


class HeadsProcess:
    """What the process for heads does; `read` comes first."""

    def __init__(self) -> None:
        self._space = HeadSpace([])
        self._calibration: HeadCalibration | None = None
        self._made: dict[tuple[str, int], dict[str, MeasuredHead]] = {}

    def read(
        self, tell: Callable[[tuple[str, float]], None], folder: str, calibration: str | None
    ) -> dict[str, Any]:
        """Read the heads of a folder, and go on with a calibration's file, or begin one.

        `tell` receives what is being read, and the share that was.  Returns `news`.
        """
        self._calibration, self._made = None, {}
        count, names = len(head_files(folder)), list[str]()

        def pass_on(name: str) -> None:
            tell((f"reading {name}", len(names) / count))
            names.append(name)

        self._space = read_heads(folder, tell=pass_on)
        if calibration is None:
            self._calibration = calibration_of(self._space, SEED)
        else:
            tell((f"reading {Path(calibration).name}", 1.0))
            self._calibration = load_calibration(calibration, self._space)
        return self.news()

    def news(self) -> dict[str, Any]:
        """What pages are told: numbers of heads and comparisons, and the direction of the next."""
        number = self._present.count
        return {
            "heads": len(self._space.heads),
            "comparisons": number,
            "direction": direction_of(number).tolist(),
        }

    def answer(self, number: int, score: int) -> tuple[dict[str, Any], str]:
        """Take the score of the comparison of a number; `news`, and the text to be saved."""
        self._require(number)
        self._present.answer(score)
        return self.news(), self._present.as_json()

    def sound(self, number: int, part: str, strike: StruckModes | None) -> bytes:
        """A sound from the direction of a comparison as WAV, of bursts of noise or a strike.

        Parts are A and B of the pair, or `before`, by the first head, and `after`, by the blend
        that is preferred at present.
        """
        self._require(number)
        rate = self._space.heads[0].rate
        source = noise_bursts(rate, number) if strike is None else strike.samples(rate)
        direction = direction_of(number)
        heard = {
            name: at_ears(head, direction, source)
            for name, head in self._heads(PAIRS[part]).items()
        }
        loudest = max(float(np.abs(each).max()) for each in heard.values())
        return as_wav(heard[part] * (PEAK / loudest if loudest else 1.0), round(rate))

    def write(self, out: str) -> int:
        """Write the blend that is preferred to a file (SOFA); the number of comparisons."""
        blend = self._space.blend(self._space.weights(self._present.best))
        write_sofa(out, blend.responses(), "blend", self._present.comment)
        return self._present.count

    def _heads(self, pair: str) -> dict[str, MeasuredHead]:
        """The two heads of a pair by part, as scenes hear by them; kept for the next sound."""
        key = pair, self._present.count
        if key not in self._made:
            if pair == "blend":
                points = {"after": self._present.best}
            else:
                points = dict(zip("AB", self._present.next_pair()))
            blends = {name: self._space.blend(self._space.weights(p)) for name, p in points.items()}
            if pair == "blend":
                blends["before"] = self._space.heads[0]
            made = {name: head.equalised() for name, head in blends.items()}
            # Those of former comparisons are not heard any more.
            self._made = {each: self._made[each] for each in self._made if each[1] == key[1]}
            self._made[key] = made
        return self._made[key]

    @property
    def _present(self) -> HeadCalibration:
        if self._calibration is None:
            raise UserError("no heads were read yet; choose a folder of them first")
        return self._calibration

    def _require(self, number: int) -> None:
        present = self._present.count
        if number != present:
            raise UserError(
                f"comparison {number} is not the present one, {present}; another page may have "
                "answered it"
            )
