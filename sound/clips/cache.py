"""Modes found in clips, kept in the user's cache: what was searched once is not searched again.

Entries are named by a hash of all that they depend on, so none is ever out of date.  The cache
saves time and nothing else: what is damaged in it is made anew, and where it cannot be written,
clips are searched every time.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from carillon import provenance
from carillon.errors import UserError
from carillon.files import create_h5, open_h5
from sound.clips.extraction import ModalSound

Array = NDArray[np.float64]

PLACE = "CARILLON_CACHE"
"""Environment variable that names the folder in place of the user's own cache."""
MOST_BYTES = 1 << 28
"""Of all entries; those that were used least recently make room."""
_KIND, _SCHEMA = "clip", 1
_ARRAYS = ("frequencies", "dampings", "amplitudes", "phases", "residual")


def remembered(
    samples: Array, rate: int, modes: int | None, search: Callable[[], ModalSound]
) -> ModalSound:
    """What `search` finds in a clip, or found in it before.

    Parameters
    ----------
    samples : (s,)
        Of the clip.
    rate : int [Hz]
        Samples per second.
    modes
        How many the search keeps.
    search
        Called unless its result is in the cache.  What it raises is not kept.
    """
    folder = _folder()
    path = folder / f"{_key(samples, rate, modes)}.h5"
    with suppress(UserError, OSError):
        sound = _read(path)
        os.utime(path)
        return sound
    sound = search()
    if folder.is_absolute():  # else the user has no home
        with suppress(UserError, OSError):
            folder.mkdir(parents=True, exist_ok=True)
            _write(path, sound)
            _make_room(folder)
    return sound


def _folder() -> Path:
    from platformdirs import user_cache_path

    named = os.environ.get(PLACE)
    return (Path(named).absolute() if named else user_cache_path("carillon")) / "clips"


def _key(samples: Array, rate: int, modes: int | None) -> str:
    digest = hashlib.sha256(_origin())
    digest.update(f"{rate} {modes}".encode())
    digest.update(samples.astype("<f8").tobytes())
    return digest.hexdigest()


@cache
def _origin() -> bytes:
    """Other code finds other modes; other libraries and processors, other last digits."""
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.read_bytes())
    digest.update(json.dumps([provenance.versions(), provenance.processor()]).encode())
    return digest.digest()


def _read(path: Path) -> ModalSound:
    with open_h5(path, _KIND, _SCHEMA, sealed=True) as file:
        arrays = {name: file[name][()] for name in _ARRAYS}
        evidence = json.loads(file.attrs["evidence"])
        return ModalSound(**arrays, rate=int(file.attrs["rate"]), evidence=evidence)


def _write(path: Path, sound: ModalSound) -> None:
    with create_h5(path, _KIND, _SCHEMA, sealed=True) as file:
        for name in _ARRAYS:
            file[name] = getattr(sound, name)
        file.attrs["rate"] = sound.rate
        file.attrs["evidence"] = json.dumps(sound.evidence)


def _make_room(folder: Path) -> None:
    """Remove the entries used least recently, until the others take no more than `MOST_BYTES`."""
    entries = [(path, path.stat()) for path in folder.glob("*.h5")]
    size = sum(status.st_size for _, status in entries)
    for path, status in sorted(entries, key=lambda entry: entry[1].st_mtime_ns):
        if size <= MOST_BYTES:
            return
        path.unlink(missing_ok=True)
        size -= status.st_size
