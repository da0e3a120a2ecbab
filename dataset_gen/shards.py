"""One job, one HDF5 shard: written whole or not at all, validated whenever it is read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from carillon import provenance
from carillon.errors import UserError
from carillon.files import create_h5, open_h5
from dataset_gen.element import Array

KIND = "dataset"
SCHEMA = 1
CHUNK_ROWS = 4096
UNIT = "GPa"

_LONG_NAMES = {
    "fine": "Young's moduli of the eight fine cells, bit order x + 2 y + 4 z, 0 is void",
    "coarse": "fitted Young's moduli at the coarse element's quadrature points, bit order",
    "residual": "root of the objective relative to its value for zero moduli",
    "converged": "whether the minimiser settled",
}
_COLUMNS = {"fine": (8,), "coarse": (8,), "residual": (), "converged": ()}


@dataclass(frozen=True)
class Shard:
    """Samples start..stop-1 of a seed with their fits.

    fine and coarse (n, 8) in GPa, residual (n,), converged (n,).
    """

    objective: str
    poisson: float
    seed: int
    start: int
    stop: int
    fine: Array
    coarse: Array
    residual: Array
    converged: NDArray[np.bool_]
    provenance: dict[str, Any]


def write_shard(path: str | Path, shard: Shard, parameters: dict[str, Any]) -> None:
    """Write `shard` atomically, with checksums and provenance."""
    with create_h5(path, KIND, SCHEMA) as file:
        file.attrs["objective"] = shard.objective
        file.attrs["poisson"] = shard.poisson
        file.attrs["seed"] = shard.seed
        file.attrs["sample_range"] = (shard.start, shard.stop)
        for name, long_name in _LONG_NAMES.items():
            values = getattr(shard, name)
            dataset = file.create_dataset(
                name,
                data=values,
                chunks=(min(CHUNK_ROWS, len(values)), *values.shape[1:]),
                compression="gzip",
                compression_opts=4,
                shuffle=True,
                fletcher32=True,
            )
            dataset.attrs["long_name"] = long_name
            dataset.attrs["units"] = UNIT if name in ("fine", "coarse") else "1"
        provenance.write(file, parameters)


def _attribute(path: Path, file: h5py.File, name: str) -> Any:
    if name not in file.attrs:
        raise UserError(f"{path}: has no attribute {name!r}; generate the file again")
    return file.attrs[name]


def _column(path: Path, file: h5py.File, name: str, rows: int) -> NDArray[Any]:
    if name not in file:
        raise UserError(f"{path}: has no dataset {name!r}; generate the file again")
    expected = (rows, *_COLUMNS[name])
    if file[name].shape != expected:
        raise UserError(
            f"{path}: {name} has shape {file[name].shape}, expected {expected} from its sample "
            "range; generate the file again"
        )
    return np.asarray(file[name][()])


def _require_sane(path: Path, shard: Shard) -> None:
    bad = ~np.isfinite(shard.fine).all(axis=1) | ~np.isfinite(shard.coarse).all(axis=1)
    bad |= (shard.fine < 0).any(axis=1) | ~shard.fine.any(axis=1) | (shard.coarse <= 0).any(axis=1)
    bad |= ~np.isfinite(shard.residual) | (shard.residual < 0)
    if bad.any():
        raise UserError(
            f"{path}: sample {shard.start + int(bad.argmax())} holds moduli or residuals out of "
            f"range ({bad.sum()} such samples); generate the file again"
        )


def read_shard(path: str | Path) -> Shard:
    """Read and validate one shard.

    Raises
    ------
    UserError
        If the file is missing, damaged, of another kind or schema, or holds impossible values.
    """
    path = Path(path)
    with open_h5(path, KIND, SCHEMA) as file:
        start, stop = (int(bound) for bound in _attribute(path, file, "sample_range"))
        columns = {name: _column(path, file, name, stop - start) for name in _COLUMNS}
        shard = Shard(
            objective=str(_attribute(path, file, "objective")),
            poisson=float(_attribute(path, file, "poisson")),
            seed=int(_attribute(path, file, "seed")),
            start=start,
            stop=stop,
            fine=columns["fine"].astype(float),
            coarse=columns["coarse"].astype(float),
            residual=columns["residual"].astype(float),
            converged=columns["converged"].astype(bool),
            provenance=provenance.read(file),
        )
    _require_sane(path, shard)
    return shard


def _require_consistent(paths: Sequence[str | Path], shards: Sequence[Shard]) -> None:
    first = shards[0]
    for path, shard in zip(paths, shards):
        for name in ("objective", "poisson"):
            found, expected = getattr(shard, name), getattr(first, name)
            if found != expected:
                raise UserError(
                    f"{path}: fitted with {name} {found}, but {paths[0]} with {expected}; "
                    "train on shards of one kind"
                )


def _require_disjoint(paths: Sequence[str | Path], shards: Sequence[Shard]) -> None:
    order = sorted(range(len(shards)), key=lambda i: (shards[i].seed, shards[i].start))
    for before, after in zip(order, order[1:]):
        one, two = shards[before], shards[after]
        if one.seed == two.seed and two.start < one.stop:
            raise UserError(
                f"{paths[after]}: samples {two.start}..{two.stop - 1} of seed {two.seed} overlap "
                f"{one.start}..{one.stop - 1} of {paths[before]}; list every sample once"
            )


def read_shards(paths: Sequence[str | Path]) -> list[Shard]:
    """Read shards that belong together, ordered by seed and sample number.

    Raises
    ------
    UserError
        If there is none, one is invalid, objectives or Poisson's ratios differ, or samples overlap.
    """
    if not paths:
        raise UserError("no dataset given, name at least one shard")
    shards = [read_shard(path) for path in paths]
    _require_consistent(paths, shards)
    _require_disjoint(paths, shards)
    return sorted(shards, key=lambda shard: (shard.seed, shard.start))
