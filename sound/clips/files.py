"""Clips by the name of their files."""

from __future__ import annotations

from pathlib import Path

from carillon.errors import UserError
from sound.clips.extraction import ModalSound, extract
from sound.clips.wav import read_wav


def extract_file(path: str | Path, modes: int | None = None, visible: bool = False) -> ModalSound:
    """Modes of the clip in a WAV file, see `extract`, whose errors then name the file."""
    samples, rate = read_wav(path)
    try:
        return extract(samples, rate, modes, visible)
    except UserError as error:
        raise UserError(f"{path}: {error}") from None
