"""Result files with something else in them (test support)."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np

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


def put(name: str, change: Callable[[np.ndarray], object]) -> Callable[[h5py.File], None]:
    """What puts in place of a dataset what `change` makes of its values."""

    def edit(file: h5py.File) -> None:
        values = file[name][()]
        del file[name]
        file[name] = change(values)

    return edit
