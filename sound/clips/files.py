"""Modes of clips in files, and names of clips."""

import hashlib
import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.files.cache import remembered
from carillon.files.datasets import number, read, refused
from carillon.files.hdf5 import create_h5, open_h5
from carillon.records import provenance
from sound.clips.extraction import ModalSound, Progress, extract
from sound.clips.wav import read_wav

_KIND, _SCHEMA = "clip", 1
_MODES = ("frequencies", "dampings", "amplitudes", "phases")
_ARRAYS = (*_MODES, "residual")


def extract_file(
    path: str | Path,
    modes: int | None = None,
    visible: bool = False,
    allow_clipped: bool = False,
    progress: Progress | None = None,
) -> ModalSound:
    """Modes of the clip in a sound file, see `extract`, whose errors then name the file.

    They come from the user's cache if the clip was searched before.  Clipped clips are refused
    unless `allow_clipped`.
    """
    samples, rate = read_wav(path, allow_clipped)
    try:
        key = _key(samples, rate, modes)
        return remembered(
            "clips", key, lambda: extract(samples, rate, modes, visible, progress), _read, _write
        )
    except UserError as error:
        raise UserError(f"{path}: {error}") from None


def clip_names(clips: Sequence[str | Path]) -> list[str]:
    """File names of clips without folder and ending, or numbers if those are not unique."""
    names = [Path(clip).stem for clip in clips]
    unique = len(set(names)) == len(names)
    return names if unique else [f"clip {number + 1}" for number in range(len(names))]


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
    sources = [*room.glob("clips/*.py"), *room.glob("synthesis/*.py"), room / "levels.py"]
    for source in sorted(sources):
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
