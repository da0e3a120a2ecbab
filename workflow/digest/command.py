"""`python -m workflow digest PATH...`: SHA-256 of what result files say, wherever they are from."""

from __future__ import annotations

import argparse
import hashlib
import json
from pathlib import Path

import h5py
import numpy as np

from carillon.errors import UserError

CIRCUMSTANCES = frozenset(
    {"provenance", "timings", "hcms", "peak_memory_bytes", "ranks", "threads", "forest_sha256"}
)
"""Groups and attributes that tell where, how fast and from which file, not what."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("paths", nargs="+", type=Path, help="HDF5 files, or folders of them")
    parser.add_argument("--json", action="store_true")


def run(arguments: argparse.Namespace) -> int:
    """Print a digest for every file."""
    digests = {str(path): digest(path) for path in _files(arguments.paths)}
    if arguments.json:
        print(json.dumps(digests, indent=2))
    else:
        print("\n".join(f"{value}  {path}" for path, value in digests.items()))
    return 0


def digest(path: Path) -> str:
    """SHA-256 of the datasets and attributes of an HDF5 file, but for its circumstances.

    Raises
    ------
    UserError
        If the file cannot be read.
    """
    found = hashlib.sha256()

    def add(name: str, entry: h5py.Group | h5py.Dataset) -> None:
        if CIRCUMSTANCES.intersection(name.split("/")):
            return
        found.update(name.encode())
        for key in sorted(set(entry.attrs) - CIRCUMSTANCES):
            found.update(f"{key}={np.asarray(entry.attrs[key]).tolist()!r}".encode())
        if isinstance(entry, h5py.Dataset):
            found.update(f"{entry.dtype}{entry.shape}".encode())
            found.update(np.ascontiguousarray(entry[()]).tobytes())

    try:
        with h5py.File(path) as file:
            add("/", file)
            file.visititems(add)
    except OSError as error:
        raise UserError(f"{path} cannot be read as HDF5: {error}") from None
    return found.hexdigest()


def _files(paths: list[Path]) -> list[Path]:
    files = []
    for path in paths:
        if not path.exists():
            raise UserError(f"there is no {path}; name result files, or folders that hold some")
        files += sorted(path.rglob("*.h5")) if path.is_dir() else [path]
    if not files:
        raise UserError(f"no HDF5 file in {', '.join(map(str, paths))}")
    return files
