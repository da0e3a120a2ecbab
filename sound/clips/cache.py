"""Cache of the modes of clips, so that a clip is searched only once."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

from carillon.arrays import Array
from carillon.files.cache import remembered
from carillon.files.datasets import number, read, refused
from carillon.files.hdf5 import create_h5, open_h5
from carillon.records import provenance
from sound.clips.extraction import ModalSound

_KIND, _SCHEMA = "clip", 1
_MODES = ("frequencies", "dampings", "amplitudes", "phases")
_ARRAYS = (*_MODES, "residual")


def remembered_modes(
    samples: Array, rate: int, modes: int | None, search: Callable[[], ModalSound]
) -> ModalSound:
    """The modes of a clip, by `search` or from the cache.

    Parameters
    ----------
    samples : (s,)
        Samples of the clip.
    rate : int [Hz]
        Samples per second.
    modes
        Number of modes that the search keeps.
    search
        Called unless its result is in the cache.  Its exceptions are not cached.
    """
    return remembered("clips", _key(samples, rate, modes), search, _read, _write)


def _key(samples: Array, rate: int, modes: int | None) -> str:
    digest = hashlib.sha256(_origin())
    digest.update(f"{rate} {modes}".encode())
    digest.update(samples.astype("<f8").tobytes())
    return digest.hexdigest()


@cache
def _origin() -> bytes:
    """Hash of code, libraries and processor; with others, modes differ or their last digits do."""
    digest = hashlib.sha256()
    room = Path(__file__).parent.parent
    for source in sorted([*room.glob("clips/*.py"), *room.glob("synthesis/*.py")]):
        digest.update(source.read_bytes())
    digest.update(json.dumps([provenance.versions(), provenance.processor()]).encode())
    return digest.digest()


def _read(path: Path) -> ModalSound:
    with open_h5(path, _KIND, _SCHEMA, sealed=True) as file:
        arrays = {name: read(file, name, (None,)) for name in _ARRAYS}
        rate = int(number(file, "rate", 1.0))
        if len({len(arrays[name]) for name in _MODES}) != 1:
            raise refused(file, "has arrays of different lengths")
        values = arrays["frequencies"]
        ascend = (
            (np.diff(values) >= 0.0).all() and (values > 0.0).all() and (values < rate / 2).all()
        )
        if not ascend or (arrays["dampings"] < 0.0).any():
            raise refused(file, "holds modes that no clip has")
        try:
            evidence = json.loads(file.attrs["evidence"])
        except (KeyError, TypeError, ValueError):
            raise refused(file, "has no evidence") from None
        return ModalSound(**arrays, rate=rate, evidence=evidence)


def _write(path: Path, sound: ModalSound) -> None:
    with create_h5(path, _KIND, _SCHEMA, sealed=True) as file:
        for name in _ARRAYS:
            file[name] = getattr(sound, name)
        file.attrs["rate"] = sound.rate
        file.attrs["evidence"] = json.dumps(sound.evidence)
