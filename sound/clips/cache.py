"""Modes found in clips are kept: what was searched once is not searched again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from carillon import provenance
from carillon.cache import remembered
from carillon.files import create_h5, open_h5
from sound.clips.extraction import ModalSound

Array = NDArray[np.float64]

_KIND, _SCHEMA = "clip", 1
_ARRAYS = ("frequencies", "dampings", "amplitudes", "phases", "residual")


def remembered_modes(
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
    return remembered("clips", _key(samples, rate, modes), search, _read, _write)


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
