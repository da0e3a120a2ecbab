"""How WAV files are laid out: chunks with their lengths, of which one holds the samples."""

from __future__ import annotations

import os
from pathlib import Path

UNKNOWN = 0x7FFF_F000
"""Length from which on it stands for one that was not known when the file was begun: programs that
write to a pipe cannot come back to it."""
MOST_CHUNKS = 1000
"""Looked at; a recording has a few."""
_HEAD = 12


def missing_bytes(path: str | Path) -> int:
    """Bytes of samples that a WAV file announces and does not have; 0 for any other file.

    Libraries take what there is, so that half a recording would pass for a whole one.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    size = os.path.getsize(path)
    with open(path, "rb") as file:
        head = file.read(_HEAD)
        if head[:4] != b"RIFF" or head[8:] != b"WAVE":
            return 0
        place = _HEAD
        for _ in range(MOST_CHUNKS):
            file.seek(place)
            name, length = file.read(4), int.from_bytes(file.read(4), "little")
            place += 8
            if place > size:
                break
            if name == b"data":
                return max(0, place + length - size) if length < UNKNOWN else 0
            place += length + length % 2
    return 0
