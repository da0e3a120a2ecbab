"""Result files with something else in them (test support)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py

from carillon.files import hdf5


@contextmanager
def edited(path: Path) -> Iterator[h5py.File]:
    """Open a sealed HDF5 file for changes that its checksum does not give away."""
    with h5py.File(path, "r+") as file:
        yield file
    reseal(path)


def reseal(path: Path) -> None:
    """Make the checksum match, so that what it would have caught gets past it."""
    with open(path, "rb+") as stream:
        stream.write(hdf5._seal_of(stream))
