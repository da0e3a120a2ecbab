"""`carillon digest PATH...`: SHA-256 of what result files say, wherever they are from."""

import argparse
import hashlib
import json
from contextlib import suppress
from pathlib import Path

import h5py
import numpy as np

from carillon.errors import UserError
from carillon.files.hdf5 import kind_of, open_h5
from carillon.files.paths import cause

CIRCUMSTANCES = {
    *("provenance", "timings", "hcms", "peak_memory_bytes", "ranks", "threads"),
    *("forest_sha256", "settings", "code", "version"),
}
"""Groups, datasets and attributes that tell where, how fast, from which files and after which wish,
not what was found."""
TIMES = "history/seconds"
"""A dataset of wall times among others that are none."""
OMITTED = CIRCUMSTANCES | {"seconds", "processor_seconds", "evaluations_per_minute", "workers"}
"""Attributes, and keys of texts in JSON, that tell circumstances."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("paths", nargs="+", type=Path, help="HDF5 files, or folders of them")
    parser.add_argument("--json", action="store_true")


def run(arguments: argparse.Namespace) -> int:
    """Print a digest for every file, and of two folders what differs."""
    digests = {path: digest(path) for path in _files(arguments.paths)}
    if arguments.json:
        print(json.dumps({str(path): value for path, value in digests.items()}, indent=2))
        return 0
    print("\n".join(f"{value}  {path}" for path, value in digests.items()))
    if len(arguments.paths) == 2 and all(path.is_dir() for path in arguments.paths):
        print(_comparison(digests, *arguments.paths))
    return 0


def _comparison(digests: dict[Path, str], one: Path, other: Path) -> str:
    """How many files two folders have in common, and which of them differ."""
    here, there = (
        {
            str(path.relative_to(folder)): value
            for path, value in digests.items()
            if folder in path.parents
        }
        for folder in (one, other)
    )
    both = sorted(set(here) & set(there))
    different = [name for name in both if here[name] != there[name]]
    alone = len(here) + len(there) - 2 * len(both)
    verdict = "all equal" if not different else f"{len(different)} differ: {', '.join(different)}"
    return f"{len(both)} files in both, {verdict}; {alone} in one of them alone"


def digest(path: Path) -> str:
    """SHA-256 of the datasets and attributes of an HDF5 file, but for its circumstances.

    Raises UserError if the file cannot be read, is no result, or does not match the checksum it
    begins with.
    """
    checksum = hashlib.sha256()

    def add(name: str, entry: h5py.Group | h5py.Dataset) -> None:
        if CIRCUMSTANCES.intersection(name.split("/")) or name == TIMES:
            return
        checksum.update(name.encode())
        for key in sorted(set(entry.attrs) - OMITTED):
            checksum.update(f"{key}={np.asarray(entry.attrs[key]).tolist()!r}".encode())
        if isinstance(entry, h5py.Dataset):
            checksum.update(f"{entry.dtype}{entry.shape}".encode() + _bytes_of(entry))

    kind, schema = kind_of(path, "a result file (HDF5)")
    if not kind:
        raise UserError(f"{path}: is damaged or no HDF5 file of this project; name a result file")
    with open_h5(path, kind, schema, sealed=True) as file:
        add("/", file)
        file.visititems(add)
    return checksum.hexdigest()


def _bytes_of(dataset: h5py.Dataset) -> bytes:
    """What a dataset holds; of a text in JSON what is no circumstance."""
    if h5py.check_string_dtype(dataset.dtype) is None:
        return np.ascontiguousarray(dataset[()]).tobytes()
    texts = np.asarray(dataset.asstr()[()], dtype=object)
    return repr([_without_circumstances(text) for text in texts.ravel()]).encode()


def _without_circumstances(text: str) -> str:
    with suppress(ValueError):
        values = json.loads(text)
        if isinstance(values, dict):
            return json.dumps({key: values[key] for key in sorted(set(values) - OMITTED)})
    return text


def _files(paths: list[Path]) -> list[Path]:
    """Files among the paths and below the folders, but for those that killed writers have left."""
    files: list[Path] = []
    for path in paths:
        try:
            if path.is_dir():
                below = sorted(path.rglob("*.h5"))
                files += [file for file in below if not file.name.startswith(".")]
            elif path.is_file():
                files.append(path)
            else:
                raise UserError(
                    f"{path}: no such file or folder; name result files, or folders that hold some"
                )
        except OSError as error:
            raise UserError(f"{path}: cannot be read ({cause(error)})") from None
    if not files:
        raise UserError(f"no HDF5 file in {', '.join(map(str, paths))}")
    return files
