"""Keys and files of what radiation keeps in the user's cache."""

import hashlib

import h5py
import numpy as np

from carillon.arrays import Array, Complex, Integers
from carillon.files.datasets import read


def key_of(constants: tuple[object, ...], *arrays: Array | Integers) -> str:
    """Hash of constants and arrays."""
    key = hashlib.sha256(repr(constants).encode())
    for values in arrays:
        key.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
    return key.hexdigest()


def put_complex(file: h5py.File, values: Complex) -> None:
    """Write complex values as a file's `real` and `imaginary`."""
    file["real"], file["imaginary"] = values.real, values.imag


def get_complex(file: h5py.File) -> Complex:
    """Read complex values (a, b) of `put_complex`; raises UserError if they are not there."""
    real, imaginary = (read(file, part, (None, None)) for part in ("real", "imaginary"))
    return np.asarray(real + 1j * imaginary)
