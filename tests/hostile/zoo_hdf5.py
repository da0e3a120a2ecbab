"""HDF5 files of every kind, damaged in every way: some caught by the seal, some with a new one."""

import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

from carillon.files.hdf5 import SEAL_BYTES
from tests.edited_files import edited

KINDS = ("shard", "forests", "tree0", "modes", "design")
"""Files that programs read, each made by one of them."""
MAIN = {"shard": "fine", "forests": None, "tree0": None, "modes": "modes", "design": "modes"}
"""The dataset that matters; the first one of numbers if None."""

Change = Callable[[h5py.File, str], None]


def make(folder: Path) -> None:
    """Write KIND-DAMAGE.h5 for every kind of file and damage, and files that are no such files."""
    for kind in KINDS:
        path = folder / f"{kind}.h5"
        content = path.read_bytes()
        half = len(content) // 2
        flipped = bytearray(content)
        flipped[half] ^= 1
        _write(folder, kind, "cut", content[:half])
        _write(folder, kind, "flipped", bytes(flipped))
        _write(folder, kind, "unsealed", bytes(SEAL_BYTES) + content[SEAL_BYTES:])
        _write(folder, kind, "longer", content + b"more")
        name = MAIN[kind] or _first_numbers(path)
        for damage, change in CHANGES.items():
            changed = Path(shutil.copy(path, folder / f"{kind}-{damage}.h5"))
            with edited(changed) as file:
                change(file, name)
    (folder / "empty.h5").touch()
    (folder / "text.h5").write_text("these are no numbers\n")
    (folder / "signature.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(2000))
    with h5py.File(folder / "foreign.h5", "w") as file:
        file["x"] = 1.0
    for name, (dataset, change) in INSIDE.items():
        kind = name.partition("-")[0]
        changed = Path(shutil.copy(folder / f"{kind}.h5", folder / f"{name}.h5"))
        with edited(changed) as file:
            values = file[dataset][()]
            change(values)
            file[dataset][...] = values


def _write(folder: Path, kind: str, damage: str, content: bytes) -> None:
    (folder / f"{kind}-{damage}.h5").write_bytes(content)


def _first_numbers(path: Path) -> str:
    found: list[str] = []

    def look(name: str, entry: object) -> None:
        if isinstance(entry, h5py.Dataset) and entry.dtype.kind == "f":
            found.append(name)

    with h5py.File(path) as file:
        file.visititems(look)
    return found[0]


def _replaced(file: h5py.File, name: str, data: object) -> None:
    del file[name]
    file[name] = data


def _nan(file: h5py.File, name: str) -> None:
    values = file[name][()]
    values.reshape(-1)[0] = np.nan
    file[name][...] = values


def _claim(file: h5py.File, name: str) -> None:
    """A dataset of petabytes, of which nothing is there."""
    shape = file[name].shape
    del file[name]
    file.create_dataset(name, (1 << 47, *shape[1:]), np.dtype("f8"), chunks=(1, *shape[1:]))


def _link(file: h5py.File, name: str) -> None:
    del file[name]
    file[name] = h5py.ExternalLink("/etc/passwd", "/x")


def _outside(file: h5py.File, name: str) -> None:
    """Raw bytes of a dataset that lie in another file."""
    shape = file[name].shape
    del file[name]
    size = int(np.prod(shape)) * 8
    file.create_dataset(name, shape, float, external=[("/etc/passwd", 0, size)])


def _virtual(file: h5py.File, name: str) -> None:
    shape = file[name].shape
    del file[name]
    layout = h5py.VirtualLayout(shape=shape, dtype=float)
    layout[...] = h5py.VirtualSource("/etc/passwd", "x", shape=shape)
    file.create_virtual_dataset(name, layout)


def _loop(file: h5py.File, name: str) -> None:
    del file[name]
    file[name] = h5py.SoftLink(f"/{name}")


CHANGES: dict[str, Change] = {
    "missing": lambda file, name: file.__delitem__(name),
    "words": lambda file, name: _replaced(file, name, ["some", "words"]),
    "complex": lambda file, name: _replaced(file, name, file[name][()] * (1 + 1j)),
    "scalar": lambda file, name: _replaced(file, name, 1.0),
    "shape": lambda file, name: _replaced(file, name, file[name][()].reshape(-1)[:-1]),
    "nothing": lambda file, name: _replaced(file, name, file[name][()].reshape(-1)[:0]),
    "group": lambda file, name: (file.__delitem__(name), file.create_group(name))[0],
    "nan": _nan,
    "claims": _claim,
    "link": _link,
    "outside": _outside,
    "virtual": _virtual,
    "loop": _loop,
    "kind": lambda file, name: file.attrs.__setitem__("kind", "recipe"),
    "schema": lambda file, name: file.attrs.__setitem__("schema_version", 99),
    "no-kind": lambda file, name: file.attrs.__delitem__("kind"),
    "odd-schema": lambda file, name: file.attrs.__setitem__("schema_version", "one"),
}
"""What is changed of a file, whose seal then is made anew."""

INSIDE: dict[str, tuple[str, Callable[[np.ndarray], object]]] = {
    "modes-eigenvalues-nan": ("eigenvalues", lambda values: values.__setitem__(8, np.nan)),
    "modes-eigenvalues-inf": ("eigenvalues", lambda values: values.__setitem__(-1, np.inf)),
    "modes-young-nan": ("young", lambda values: values.fill(np.nan)),
    "modes-young-negative": ("young", lambda values: values.fill(-1e9)),
    "modes-cells-beyond": ("cells", lambda values: values.fill(10**6)),
    "modes-cells-below": ("cells", lambda values: values.fill(-5)),
    "design-frequencies-nan": ("targets/frequencies", lambda values: values.fill(np.nan)),
    "design-faces-below": ("surface/faces", lambda values: values.fill(-9)),
}
"""Single values that make no sense, under a seal that matches: KIND-WHAT, dataset, change."""
