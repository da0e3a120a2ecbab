"""Results of an example, read when asked for."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.files.modes_file import ModesFile, read_modes
from sound.clips.files import extract_file
from sound.clips.wav import read_wav
from sound.project.design import Design
from sound.project.design_file import read_design
from sound.rendering.clip_level import resampled
from sound.synthesis.sinusoids import Bank, ring
from studies.base.conditions import Record
from studies.base.results import Results
from studies.sounds.examples import DESIGN, REACHED, START, TRUTH, Example, examples

Array = NDArray[np.float64]

MODES = "modes"
"""Folder of modes alone below that of the sounds."""
CLIPS = "clips"
"""Folder of the clips."""


@dataclass(frozen=True)
class TargetSounds:
    """A clip from where its modes ring freely on, and what is known of it."""

    clip: Array
    """(s,) its samples."""
    modes: Array
    """(s,) all modes that were found in it."""
    wanted: Array
    """(s,) those that are designed, as a material sounds that has them all."""


@dataclass(frozen=True)
class SoundResults(Results):
    """Results of one example, below the folder of all of them."""

    name: str

    @cached_property
    def example(self) -> Example:
        """What was asked for."""
        return examples(self.config)[self.name]

    def file(self, name: str) -> Path:
        """One of the example's files."""
        return self.folder / self.name / name

    @cached_property
    def designs(self) -> dict[str, Design]:
        """Designs of all edits by their folders, the last one at the end."""
        return {part: read_design(self.folder / part / DESIGN) for part in self.example.parts}

    @property
    def design(self) -> Design:
        """The final design."""
        return self.designs[self.name]

    @cached_property
    def start(self) -> Design:
        """The uniform material with the targets of the final design."""
        return read_design(self.file(START))

    @cached_property
    def truth(self) -> ModesFile:
        """Modes of the fine model with the final material."""
        return read_modes(self.file(TRUTH), with_modes=False)

    @cached_property
    def optimisers(self) -> dict[str, Any]:
        """Output of `sound benchmark`; empty if the optimisers are not compared here."""
        if not self.example.compared:
            return {}
        return self.read_json(f"{self.name}/optimisers.json")

    @cached_property
    def reached(self) -> dict[str, Any]:
        """Output of `sound reach`; without `modes` where the search was good enough, and empty of a
        pair, of which it is not asked."""
        if self.example.by_default:
            return {}
        return self.read_json(f"{self.name}/{REACHED}")

    @property
    def absent(self) -> tuple[str, ...]:
        """Tables that there is nothing for."""
        there = {
            "checks": self.design.evidence.get("checks"),
            "reach": "modes" in self.reached,
            "optimisers": self.optimisers,
            "evaluation": self.optimisers,
        }
        return tuple(name for name, is_there in there.items() if not is_there)

    @property
    def origins(self) -> dict[str, Record]:
        """Provenance of every file that the page draws on."""
        name, compared, reached = self.name, self.optimisers, self.reached
        return {
            **{f"{part}/{DESIGN}": each.provenance for part, each in self.designs.items()},
            f"{name}/{START}": self.start.provenance,
            f"{name}/{TRUTH}": self.truth.provenance,
            **({f"{name}/{REACHED}": reached["provenance"]} if reached else {}),
            **({f"{name}/optimisers.json": compared["provenance"]} if compared else {}),
        }

    def history(self, part: str) -> NDArray[np.void]:
        """Rows of an edit's own search, its seconds and evaluations counted from its beginning."""
        before = self.example.parts[: self.example.parts.index(part)]
        rows = self.designs[part].history.copy()
        if before:
            last = self.designs[before[-1]].history[-1]
            rows = rows[rows["seconds"] > last["seconds"]]
            for column in ("seconds", "evaluations"):
                rows[column] -= last[column]
        return rows

    def sound(self, state: str, name: str) -> tuple[Array, int]:
        """Samples (s,) and rate [Hz] of a rendered sound, or of a clip."""
        return read_wav(self.file(f"{state}/{name}.wav"))

    def modes_alone(self, state: str, name: str) -> Array:
        """Samples (s,) of a rendered sound without the noise of the clips."""
        return read_wav(self.file(f"{state}/{MODES}/{name}.wav"))[0]

    def target(self, name: str, rate: int) -> TargetSounds:
        """A clip and its modes, sampled at `rate` [Hz]."""
        targets = self.design.targets
        point = targets.names.index(name)
        clip, own = self.sound(CLIPS, name)
        # The design does not hold where in its clip the modes begin; the user's cache does.
        extracted = extract_file(self.file(f"{CLIPS}/{name}.wav"))
        begin, count = round(extracted.evidence["strike_seconds"] * own), len(extracted.residual)
        bank = Bank(targets.frequencies, targets.dampings, own)
        requested = ring(bank, [(0.0, targets.amplitudes[point])], count)
        parts = (clip[begin : begin + count], extracted.modal_part(), requested)
        return TargetSounds(*(resampled(part, own, rate) for part in parts))
