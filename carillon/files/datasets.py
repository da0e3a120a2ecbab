"""Arrays and numbers of HDF5 files, described as they are written and checked as they are read.

A seal tells that a file is as it was written, not that what was written makes sense.
"""

from collections.abc import Sequence
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from carillon.errors import UserError

REAL, INTEGER = "f", "iu"
"""Kinds of numbers, as numpy's codes."""

_NAMES = {REAL: "real numbers", INTEGER: "integers"}


def put(
    group: h5py.Group, name: str, data: NDArray[Any], units: str, long_name: str | None = None
) -> None:
    """Write one dataset with a checksum, its unit and what it is."""
    dataset = group.create_dataset(name, data=data, fletcher32=True, chunks=True)
    dataset.attrs["units"] = units
    if long_name is not None:
        dataset.attrs["long_name"] = long_name


def find(
    group: h5py.Group, name: str, shape: Sequence[int | None], kind: str = REAL
) -> h5py.Dataset:
    """The dataset `name`, which is there and has this shape and kind of numbers.

    `shape`: None stands for any length. Raises UserError if it is anything else; nothing of it has
    been read then.
    """
    dataset = group.get(name)
    if not isinstance(dataset, h5py.Dataset):
        raise refused(group, f"is incomplete, it has no dataset {name!r}")
    if dataset.dtype.kind not in kind:
        raise refused(group, f"dataset {name!r} holds {dataset.dtype}, expected {_NAMES[kind]}")
    fits = dataset.shape is not None and len(dataset.shape) == len(shape)
    if not fits or any(b not in (None, a) for a, b in zip(dataset.shape, shape)):
        expected = str(tuple(shape)).replace("None", "any")
        raise refused(group, f"dataset {name!r} has shape {dataset.shape}, expected {expected}")
    return dataset


def read(
    group: h5py.Group, name: str, shape: Sequence[int | None], kind: str = REAL
) -> NDArray[Any]:
    """All of the dataset that `find` finds; real numbers must be finite.

    Raises UserError if it is not there, of another shape or kind, or holds what is no number.
    """
    return finite(group, name, find(group, name, shape, kind)[()])


def finite(group: h5py.Group, name: str, values: NDArray[Any]) -> NDArray[Any]:
    """The values of the dataset `name`, or a part of them, if all are finite.

    Raises UserError if not.
    """
    if not np.isfinite(values).all():
        count = int(np.count_nonzero(~np.isfinite(values)))
        raise refused(group, f"dataset {name!r} holds {count:,} values that are not finite")
    return values


def number(group: h5py.Group, name: str, low: float = -np.inf, high: float = np.inf) -> float:
    """The attribute `name`, a finite number in `low`..`high`.

    Raises UserError if it is not there or anything else.
    """
    try:
        value = float(group.attrs[name])
    except (KeyError, TypeError, ValueError):
        raise refused(group, f"is incomplete, it has no number {name!r}") from None
    if not (np.isfinite(value) and low <= value <= high):
        raise refused(group, f"{name!r} is {value:g}, expected {low:g} to {high:g}")
    return value


def refused(group: h5py.Group, fault: str) -> UserError:
    """The error to raise for a file whose content has a fault."""
    place = "" if group.name in ("/", None) else f" (in {group.name})"
    return UserError(f"{group.file.filename}: {fault}{place}; generate the file again")
