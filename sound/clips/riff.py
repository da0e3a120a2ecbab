"""WAV files cut short: their header announces more samples than there are."""

from __future__ import annotations

import os
from pathlib import Path

UNKNOWN = 0x7FFF_F000
"""Least length of a chunk that stands for an unknown one: programs that write to a pipe cannot fill
in the length later."""
MOST_CHUNKS = 1000
"""Greatest number of chunks that are read; a recording has a few."""
_HEAD = 12
"""Length of the file's head [bytes]."""


def missing_bytes(path: str | Path) -> int:
    """Number of bytes of samples that a WAV file announces but lacks; 0 for any other file.

    Libraries read what there is, so half a recording would pass for a whole one.

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
