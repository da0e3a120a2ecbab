"""One recording in other formats of samples, at other rates and with more channels."""

import json
import tempfile
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import soundfile
from scipy.signal import resample_poly

from carillon.arrays import Array
from carillon.files.atomic import atomic_path
from sound.clips.wav import read_wav
from studies.base.table import Row
from studies.recordings.measurement import MODES, extract

RECORDING = "agogo-high"
"""Recording that is written in other formats."""
HIGHEST_HERTZ = 8000.0
"""Frequency up to which modes are compared: all rates hold it."""
SPAN_DECIBELS = 40.0
"""Level below the loudest mode down to which modes are looked for [dB]."""
SAME_CENTS = 1.0
"""Difference of two frequencies that are the same mode's."""
LEVELS = (1.2, 0.8)
"""Levels of two channels; the louder one is searched."""
SUBTYPES = {"PCM_U8": "8 bit", "PCM_16": "16 bit", "PCM_24": "24 bit", "FLOAT": "float"}
"""Formats of samples, and what people call them."""
RATES = (22_050, 44_100, 48_000, 96_000, 192_000)


@dataclass(frozen=True)
class Format:
    """How a sound is written."""

    rate: int
    subtype: str = "FLOAT"
    channels: int = 1

    @property
    def title(self) -> str:
        """The format for people."""
        channels = "stereo" if self.channels > 1 else "mono"
        return f"{self.rate / 1000:g} kHz, {SUBTYPES[self.subtype]}, {channels}"


def formats(rate: int) -> list[Format]:
    """What a recording of that rate is written as: each of its properties changed by itself."""
    return [
        *(Format(each) for each in RATES),
        *(Format(rate, subtype) for subtype in SUBTYPES if subtype != "FLOAT"),
        Format(rate, channels=len(LEVELS)),
    ]


def write_as(form: Format, samples: Array, rate: int, path: Path) -> None:
    """Write one channel (s,) of a sound at `rate` [Hz] in a format as WAV.

    Louder than all formats hold, it is made less loud.
    """
    ratio = Fraction(form.rate, rate)
    resampled = resample_poly(samples, ratio.numerator, ratio.denominator)
    loudest = float(np.abs(resampled).max())
    scaled = resampled * min(1.0, 0.99 / (max(LEVELS) * max(loudest, 1e-30)))
    channels = [scaled] if form.channels == 1 else [level * scaled for level in LEVELS]
    soundfile.write(path, np.stack(channels, axis=1), form.rate, subtype=form.subtype)


def compare(clip: Path, modes: Path, out: Path) -> None:
    """Write how far the modes of a recording move by the format that it is written in.

    Parameters
    ----------
    clip, modes
        The recording, and what was extracted from it.
    out
        JSON file of rows, see `differences`; of none if the recording itself was refused.
    """
    samples, rate = read_wav(clip, allow_clipped=True)
    reference = json.loads(modes.read_text()) if modes.is_file() else {}
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for form in formats(rate) if reference else []:
            written = folder / "clip.wav"
            write_as(form, samples, rate, written)
            extraction = extract(written, folder)
            row = {"format": form.title, "said": extraction.said}
            if not extraction.said:
                row |= differences(reference, json.loads((folder / MODES).read_text()))
            rows.append(row)
    with atomic_path(out) as temporary:
        temporary.write_text(json.dumps(rows, indent=1))


def differences(reference: dict[str, Any], found: dict[str, Any]) -> Row:
    """How far modes that `extract` found are from those of a reference.

    Returns
    -------
    Row
        How many `modes` there are; of the reference, how many `strong` ones lie below
        `HIGHEST_HERTZ` and not far below the loudest, and how many of these are the `same`; their
        distances, `median_cents` and `worst_cents`, from the nearest that was found; the share of
        the energy that is `explained`.
    """
    hertz, amplitudes = (
        np.array(each) for each in (reference["frequencies_hz"], reference["amplitudes"][0])
    )
    loud = amplitudes > amplitudes.max() * 10.0 ** (-SPAN_DECIBELS / 20.0)
    loud_hertz = hertz[loud & (hertz < HIGHEST_HERTZ)]
    others = np.array(found["frequencies_hz"])
    cents = 1200.0 * np.abs(np.log2(others / loud_hertz[:, None])).min(axis=1)
    return {
        "modes": len(others),
        "strong": len(loud_hertz),
        "same": int((cents < SAME_CENTS).sum()),
        "median_cents": float(np.median(cents)),
        "worst_cents": float(cents.max()),
        "explained": found["clips"][0]["explained"],
    }
