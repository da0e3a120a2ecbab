"""Head-related impulse responses in SOFA files (AES69), convention SimpleFreeFieldHRIR.

Axes are those of the standard: x points ahead, y to the left, z up, from the centre of the head.
"""

import io
import math
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.files.atomic import atomic_path
from carillon.files.hdf5 import h5_in_memory, opened_h5
from carillon.files.paths import first_line, require_file

CONVENTION = "SimpleFreeFieldHRIR"
"""The convention of SOFA that is read and written."""
EXPECTED = "a measured head (SOFA)"
"""What a file should be, for messages."""
MOST_DIRECTIONS, MOST_SAMPLES = 30_000, 32_768
"""Greatest numbers of directions, and of samples of a response, that are read."""
MOST_NUMBERS = 1 << 27
"""Greatest count of numbers of a dataset, also of one of its chunks."""
RATES = (8_000.0, 384_000.0)
"""Least and greatest sampling rate [Hz] of a measurement."""
PURE = "This is a netCDF dimension but not a netCDF variable.{:10d}"
"""Name by which netCDF knows a dataset that stands for the length of a dimension alone."""
MYSOFA_CHUNK, MYSOFA_CHUNKS, MYSOFA_TEXT = (1 << 20) - 1, 64, 4_000
"""What libmysofa 1.3 reads at most: numbers of a chunk, chunks of a dataset, bytes of a text."""
LONGEST_TEXT = 100
"""Longest text that is read of an attribute, in characters."""


@dataclass(frozen=True)
class MeasuredResponses:
    """What a file of a head holds.

    Attributes
    ----------
    title : str
        What the file calls the head.
    rate : float [Hz]
        Sampling rate.
    directions : (M, 3)
        Unit vectors from the head to the source: ahead, left, up.
    distances : (M,) [m]
        From the head's centre to the source.
    responses : (M, 2, N)
        Impulse responses at the left and the right ear.
    delays : (M, 2) [s]
        Silence before each response that the samples leave out.
    """

    title: str
    rate: float
    directions: Array
    distances: Array
    responses: Array
    delays: Array


def read_sofa(path: str | Path) -> MeasuredResponses:
    """Read the responses of a head.

    Raises UserError if there is no such file, it is not SOFA, of another convention, not of two
    ears, or holds numbers that make no sense.
    """
    path = require_file(path, EXPECTED)
    try:
        with opened_h5(path) as file:
            return _content(path, file)
    except UserError:
        raise
    except Exception as error:  # HDF5 has many ways to say that bytes make no sense
        raise UserError(
            f"{path}: is not readable as SOFA ({first_line(error)}), expected {EXPECTED}; name "
            "another file"
        ) from None


def write_sofa(path: str | Path, head: MeasuredResponses, listener: str, comment: str) -> None:
    """Write the responses of a head; the file is complete or absent.

    `listener` is a short name of whose head it is, `comment` where it is from. Data are stored as
    netCDF stores them, which is all of HDF5 that libmysofa reads.
    """
    count, ears, samples = head.responses.shape
    now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S")
    attributes = {
        **{"Conventions": "SOFA", "Version": "1.0", "SOFAConventions": CONVENTION},
        **{"SOFAConventionsVersion": "1.0", "DataType": "FIR", "RoomType": "free field"},
        **{"APIName": "Carillon", "APIVersion": "1", "ApplicationName": "Carillon"},
        **{"ApplicationVersion": "", "AuthorContact": "", "Organization": "", "References": ""},
        **{"License": "", "Origin": "", "History": "", "Comment": comment, "Title": head.title},
        **{"DateCreated": now, "DateModified": now, "DatabaseName": ""},
        "ListenerShortName": listener,
    }
    metres = ("cartesian", "metre")
    placed = {
        "ListenerPosition": ("IC", np.zeros((1, 3)), metres),
        "ListenerView": ("IC", np.array([[1.0, 0.0, 0.0]]), metres),
        "ListenerUp": ("IC", np.array([[0.0, 0.0, 1.0]]), None),
        "ReceiverPosition": (
            "RCI",
            np.array([[0.0, 0.0875, 0.0], [0.0, -0.0875, 0.0]])[:, :, None],
            metres,
        ),
        "EmitterPosition": ("ECI", np.zeros((1, 3, 1)), metres),
        "SourcePosition": ("MC", head.directions * head.distances[:, None], metres),
        "Data.IR": ("MRN", head.responses, None),
        "Data.SamplingRate": ("I", np.array([head.rate]), None),
        "Data.Delay": ("MR", head.delays * head.rate, None),
    }
    sizes = {"M": count, "R": ears, "N": samples, "E": 1, "I": 1, "C": 3}
    content = io.BytesIO()
    with h5_in_memory(content) as file:
        for name, text in attributes.items():
            _write_text(file, name, text)
        for name, size in sizes.items():
            scale = file.create_dataset(name, (size,), ">f4", track_order=True)
            scale.make_scale(PURE.format(size))
        # Numbers follow on all else: libmysofa reads headers in few pieces alone, and HDF5 begins
        # another piece where it cannot make the last one longer.
        for name, (dimensions, values, kind) in placed.items():
            dataset = _compressed(file, name, values.shape)
            if kind is not None:
                _write_text(dataset, "Type", kind[0])
                _write_text(dataset, "Units", kind[1])
            for number, dimension in enumerate(dimensions):
                dataset.dims[number].attach_scale(file[dimension])
        _write_text(file["Data.SamplingRate"], "Units", "hertz")
        for name, (_, values, _) in placed.items():
            file[name][...] = values
    with atomic_path(path) as temporary:
        temporary.write_bytes(content.getbuffer())


def _compressed(file: h5py.File, name: str, shape: tuple[int, ...]) -> h5py.Dataset:
    """A dataset of float64 in chunks of whole rows."""
    each = math.prod(shape[1:])
    rows = min(shape[0], max(MYSOFA_CHUNK // each, math.ceil(shape[0] / MYSOFA_CHUNKS)))
    return file.create_dataset(
        name,
        shape,
        np.float64,
        chunks=(rows, *shape[1:]),
        shuffle=True,
        compression="gzip",
        track_order=True,
    )


def _write_text(place: h5py.File | h5py.Dataset, name: str, text: str) -> None:
    """Write an attribute of the text's length in bytes, without a value if it is empty."""
    content = np.array(text.encode()[:MYSOFA_TEXT].decode(errors="ignore").encode())
    kind = h5py.h5t.C_S1.copy()
    kind.set_size(max(content.itemsize, 1))
    space = h5py.h5s.create(h5py.h5s.SCALAR if text else h5py.h5s.NULL)
    attribute = h5py.h5a.create(place.id, name.encode(), kind, space)
    if text:
        attribute.write(content, mtype=kind)


def _content(path: Path, file: h5py.File) -> MeasuredResponses:
    if _text(file, "Conventions") != "SOFA":
        raise UserError(f"{path}: is HDF5 but not SOFA, expected {EXPECTED}; name another file")
    convention = _text(file, "SOFAConventions")
    if convention != CONVENTION:
        raise UserError(
            f"{path}: follows the convention {convention or 'of none'!r}, expected {CONVENTION}; "
            "convert it"
        )
    if (kind := _text(file, "DataType")) != "FIR":
        raise UserError(f"{path}: holds data of type {kind!r}, expected FIR; convert it")
    responses = _numbers(path, file, "Data.IR")
    if responses.ndim != 3 or responses.shape[1] != 2:
        ears = responses.shape[1] if responses.ndim == 3 else "no"
        raise UserError(
            f"{path}: has responses at {ears} ears (shape {responses.shape}), expected two ears"
        )
    count, _, samples = responses.shape
    rates = np.unique(_numbers(path, file, "Data.SamplingRate"))
    if len(rates) != 1 or not RATES[0] <= rates[0] <= RATES[1]:
        found = ", ".join(f"{each:g}" for each in rates[:3])
        raise UserError(
            f"{path}: has a sampling rate of {found} Hz, expected one of {RATES[0]:,.0f} to "
            f"{RATES[1]:,.0f} Hz"
        )
    rate = float(rates[0])
    delays = _numbers(path, file, "Data.Delay") if "Data.Delay" in file else np.zeros((1, 2))
    if delays.shape not in ((1, 2), (count, 2)):
        raise UserError(
            f"{path}: Data.Delay has shape {delays.shape}, expected (1, 2) or ({count}, 2)"
        )
    sources = _turned(path, file, _positions(path, file, "SourcePosition", count))
    distances = np.linalg.norm(sources, axis=1)
    if not (distances > 0.0).all():
        raise UserError(f"{path}: has a source in the centre of the head, expected all outside")
    if not responses.any(axis=2).all():
        raise UserError(f"{path}: has a response of zeros alone, expected sound at both ears")
    title = _text(file, "ListenerShortName") or _text(file, "Title") or path.stem
    return MeasuredResponses(
        title,
        rate,
        sources / distances[:, None],
        distances,
        responses,
        np.broadcast_to(delays / rate, (count, 2)),
    )


def _text(file: h5py.File | h5py.Dataset, name: str) -> str:
    """An attribute as text, empty if there is none."""
    value = file.attrs.get(name, "")
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.reshape(-1)[0]
    if isinstance(value, bytes):
        value = value.decode(errors="replace")
    return value[:LONGEST_TEXT] if isinstance(value, str) else ""


def _numbers(path: Path, file: h5py.File, name: str) -> Array:
    """A dataset of finite numbers, of no more than a head has: they may be compressed."""
    if isinstance(file.get(name, getlink=True), h5py.ExternalLink | h5py.SoftLink):
        raise UserError(f"{path}: holds a link, {name!r}, expected its numbers here")
    dataset: Any = file.get(name)
    if not isinstance(dataset, h5py.Dataset) or dataset.dtype.kind not in "fiu":
        raise UserError(f"{path}: has no numbers {name!r}, expected {EXPECTED}")
    if dataset.is_virtual or dataset.external:
        raise UserError(f"{path}: {name} takes its numbers from another file, expected them here")
    most = (MOST_DIRECTIONS, MOST_DIRECTIONS, MOST_SAMPLES)
    count = max(math.prod(dataset.shape or ()), math.prod(dataset.chunks or ()))
    sizes = dataset.shape or (0,)
    if count > MOST_NUMBERS or not all(0 < size <= limit for size, limit in zip(sizes, most)):
        raise UserError(
            f"{path}: {name} has shape {dataset.shape}, expected at most {MOST_DIRECTIONS:,} "
            f"directions, {MOST_SAMPLES:,} samples and {MOST_NUMBERS:,} numbers"
        )
    values = np.asarray(dataset[()], dtype=np.float64)
    if not np.isfinite(values).all():
        wrong = int(np.count_nonzero(~np.isfinite(values)))
        raise UserError(
            f"{path}: {name} holds {wrong:,} values that are not finite, expected numbers; name "
            "another file"
        )
    return values


def _positions(
    path: Path, file: h5py.File, name: str, count: int, typed: str | None = None
) -> Array:
    """Positions (count or 1, 3) [m], from spherical (degrees) or cartesian coordinates, as the
    dataset or the one called `typed` says.
    """
    values = _numbers(path, file, name)
    if values.shape not in ((count, 3), (1, 3)):
        raise UserError(f"{path}: {name} has shape {values.shape}, expected ({count}, 3)")
    kind = _text(file[typed or name], "Type") or "cartesian"
    if kind == "cartesian":
        return values
    if kind != "spherical":
        raise UserError(f"{path}: {name} is of type {kind!r}, expected spherical or cartesian")
    azimuth, elevation, radius = np.radians(values[:, 0]), np.radians(values[:, 1]), values[:, 2]
    level = radius * np.cos(elevation)
    return np.stack(
        [level * np.cos(azimuth), level * np.sin(azimuth), radius * np.sin(elevation)], axis=1
    )


def _turned(path: Path, file: h5py.File, sources: Array) -> Array:
    """Sources (M, 3) [m] from the head, along the axes of the head: ahead, left, up."""
    ahead, up = np.array([[1.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]])
    if "ListenerPosition" in file:
        sources = sources - _positions(path, file, "ListenerPosition", len(sources))
    if "ListenerView" in file:
        ahead = _positions(path, file, "ListenerView", len(sources))
    if "ListenerUp" in file:
        typed = "ListenerView" if "ListenerView" in file else None
        up = _positions(path, file, "ListenerUp", len(sources), typed)
    left = np.cross(up, ahead)
    if not np.linalg.norm(left, axis=1).all():
        raise UserError(f"{path}: has a listener that looks straight up, expected ahead")
    axes = np.stack(np.broadcast_arrays(ahead, left, np.cross(ahead, left)), axis=1)
    axes = axes / np.linalg.norm(axes, axis=2, keepdims=True)
    return np.asarray(np.einsum("mai,mi->ma", np.broadcast_to(axes, (len(sources), 3, 3)), sources))
