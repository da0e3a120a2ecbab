"""Sounds that a page carries within itself."""

from __future__ import annotations

import base64
import io

import numpy as np
from numpy.typing import NDArray
from scipy.io import wavfile

PEAK = 0.9
"""Level of the loudest sample, where 1 is the most that a sample can hold."""


def wav_uri(sound: NDArray[np.float64], sample_rate: int, loudest: float) -> str:
    """A sound as a data URI: 16-bit mono WAV in which `loudest` is played at `PEAK`."""
    samples = np.clip(PEAK * sound / loudest, -1.0, 1.0)
    file = io.BytesIO()
    wavfile.write(file, sample_rate, np.round(32767 * samples).astype(np.int16))
    return f"data:audio/wav;base64,{base64.b64encode(file.getvalue()).decode()}"
