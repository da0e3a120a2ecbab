"""Modes of clips in files, and names of clips."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from carillon.errors import UserError
from sound.clips.cache import remembered_modes
from sound.clips.extraction import ModalSound, extract
from sound.clips.wav import read_wav


def extract_file(
    path: str | Path, modes: int | None = None, visible: bool = False, allow_clipped: bool = False
) -> ModalSound:
    """Modes of the clip in a WAV file, see `extract`, whose errors then name the file.

    They come from the user's cache if the clip was searched before.  Clipped clips are refused
    unless `allow_clipped`.
    """
    samples, rate = read_wav(path, allow_clipped)
    try:
        return remembered_modes(
            samples, rate, modes, lambda: extract(samples, rate, modes, visible)
        )
    except UserError as error:
        raise UserError(f"{path}: {error}") from None


def clip_names(clips: Sequence[str | Path]) -> list[str]:
    """File names of clips without folder and ending, or numbers if those are not unique."""
    names = [Path(clip).stem for clip in clips]
    unique = len(set(names)) == len(names)
    return names if unique else [f"clip {number + 1}" for number in range(len(names))]
