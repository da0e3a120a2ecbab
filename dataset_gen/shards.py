"""One job, one HDF5 shard: written whole or not at all, validated whenever it is read."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags
from carillon.errors import UserError
from carillon.files.hdf5 import create_h5, open_h5
from carillon.records import provenance
from dataset_gen.sampling import Moduli
from dataset_gen.settings import Settings, ShardOptions, settings_from
from dataset_gen.tasks import ROW

KIND = "dataset"
SCHEMA = 2
CHUNK_ROWS = 4096
UNIT = "GPa"

PIECE_ROWS = 16 * CHUNK_ROWS
"""Samples that are read at a time unless told otherwise, 9 MB."""
_LONG_NAMES = {
    "fine": "Young's moduli of the eight fine cells, bit order x + 2 y + 4 z, 0 is void",
    "coarse": "fitted Young's moduli at the coarse element's quadrature points, bit order",
    "residual": "root of the objective relative to its value for zero moduli",
    "converged": "whether the minimiser settled",
}

_OF_ONE_KIND = {"objective": "objective", "poisson": "Poisson's ratio", "code": "code"}
"""Settings that shards to be used together must share, with their names for people."""


@dataclass(frozen=True)
class Shard:
    """Samples with their fits, of a whole shard or of a piece of one."""

    settings: Settings
    """What decides about the rows."""
    fine: Array
    coarse: Array
    """(n, 8) moduli [GPa]."""
    residual: Array
    converged: Flags
    """(n,) see `dataset_gen.objectives.Fits`."""
    provenance: dict[str, Any]
    """Of the shard, by name."""

    @property
    def objective(self) -> str:
        """Name of the fit objective."""
        return self.settings.objective

    @property
    def poisson(self) -> float:
        """Poisson's ratio of all cells."""
        return self.settings.poisson

    @property
    def seed(self) -> int:
        """Seed of the samples."""
        return self.settings.seed

    @property
    def start(self) -> int:
        """First sample."""
        return self.settings.start

    @property
    def stop(self) -> int:
        """Past-the-last sample."""
        return self.settings.stop

    @property
    def moduli(self) -> Moduli:
        """Where the fine moduli were drawn from."""
        return self.settings.moduli

    def part(self, first: int, past: int) -> Shard:
        """The samples `first` up to `past`, counted from the shard's own start."""
        part = replace(self.settings, start=self.start + first, stop=self.start + past)
        columns = {name: getattr(self, name)[first:past] for name in _LONG_NAMES}
        return Shard(settings=part, provenance=self.provenance, **columns)


def shard_of(settings: Settings, rows: NDArray[np.void], origin: dict[str, Any]) -> Shard:
    """Shard or piece from rows of type `dataset_gen.tasks.ROW`."""
    columns = {name: np.ascontiguousarray(rows[name]) for name in _LONG_NAMES}
    return Shard(settings=settings, provenance=origin, **columns)


def origin_of(settings: Settings, options: ShardOptions) -> dict[str, Any]:
    """Provenance of a shard: that of any result, less what must not matter.

    The command is the one that makes this shard with one process on one rank. The number of cores
    and the BLAS, which may be PETSc's if that is loaded too and which fits do not call, are left
    out, so that a shard has the same bytes however it was made.
    """
    split = {name: getattr(options, name) for name in ("samples", "shard", "shards")}
    origin = provenance.record({**settings.as_dict(), **split})
    del origin["cores"], origin["blas"]
    named = {"seed": settings.seed, **split, "objective": settings.objective}
    named |= {"poisson": settings.poisson, "distribution": settings.distribution}
    named |= {"low": settings.low, "high": settings.high}
    words = " ".join(f"--{name} {value}" for name, value in named.items())
    return origin | {"command": f"python -m dataset_gen generate {words}"}


def write_rows(
    path: str | Path, settings: Settings, pieces: Iterable[NDArray[np.void]], origin: dict[str, Any]
) -> None:
    """Write a shard atomically from rows in order, keeping no more than one piece in memory.

    Not compressed: most of a modulus is random digits, of which gzip saves 17 per cent at 30 MB/s.
    Equal arguments give equal bytes.
    """
    with create_h5(path, KIND, SCHEMA, sealed=True) as file:
        file.attrs.update(settings.as_dict())
        group = file.create_group("provenance")
        for key, value in origin.items():
            group.attrs[key] = value
        columns = {name: _new_column(file, name, settings.count) for name in _LONG_NAMES}
        done = 0
        for piece in pieces:
            for name, column in columns.items():
                column[done : done + len(piece)] = piece[name]
            done += len(piece)
        if done != settings.count:
            raise UserError(
                f"{path}: {done:,} of {settings.count:,} samples could be read back from the "
                "journal, the disk loses data; run the same command again"
            )


def _new_column(file: h5py.File, name: str, count: int) -> h5py.Dataset:
    kind, shape = ROW[name].base, ROW[name].shape
    column = file.create_dataset(
        name,
        shape=(count, *shape),
        dtype=kind,
        chunks=(min(CHUNK_ROWS, count), *shape),
        fletcher32=True,
        track_times=False,
    )
    column.attrs["long_name"] = _LONG_NAMES[name]
    column.attrs["units"] = UNIT if name in ("fine", "coarse") else "1"
    return column


@contextmanager
def _opened(path: Path, checked: bool = False) -> Iterator[tuple[h5py.File, Settings]]:
    """An open shard of the right shape, and its settings; `checked` if its seal has been before."""
    with open_h5(path, KIND, SCHEMA, sealed=True, checked=checked) as file:
        try:
            settings = settings_from(file.attrs)
        except (TypeError, ValueError) as error:
            raise UserError(
                f"{path}: is damaged (settings, {error}); generate the file again"
            ) from None
        for name in _LONG_NAMES:
            expected = (settings.count, *ROW[name].shape)
            if file[name].shape != expected:
                raise UserError(
                    f"{path}: {name} has shape {file[name].shape}, expected {expected} from its "
                    "sample range; generate the file again"
                )
            if file[name].dtype != ROW[name].base:
                raise UserError(
                    f"{path}: {name} holds {file[name].dtype}, expected {ROW[name].base}; generate "
                    "the file again"
                )
        yield file, settings


def read_settings(path: str | Path, checked: bool = False) -> Settings:
    """Settings of a shard that is complete and undamaged.

    `checked`: whether all of it has been checked before. Raises UserError if the file is missing,
    damaged, or of another kind or schema.
    """
    with _opened(Path(path), checked) as (_, settings):
        return settings


def iterate_shard(path: str | Path, rows: int = PIECE_ROWS) -> Iterator[Shard]:
    """Read one shard in validated pieces of `rows` samples, in order and in constant memory.

    Each piece is a shard of its own sample range. The whole file is checked before the first one.
    Raises UserError if the file is missing, damaged, of another kind or schema, or holds impossible
    values.
    """
    count = read_settings(path).count
    return read_runs(path, [(begin, min(begin + rows, count)) for begin in range(0, count, rows)])


def read_runs(path: str | Path, runs: Sequence[tuple[int, int]]) -> Iterator[Shard]:
    """Read samples of a shard that has been checked, each run as a shard of its own.

    `runs`: first and past-the-last sample of each, counted from the start of the shard. Raises
    UserError as `iterate_shard` does; of the checksums, only those of what is read are compared.
    """
    path = Path(path)
    with _opened(path, checked=True) as (file, settings):
        origin = provenance.read(file)
        for begin, stop in runs:
            part = replace(settings, start=settings.start + begin, stop=settings.start + stop)
            columns = {name: file[name][begin:stop] for name in _LONG_NAMES}
            piece = Shard(settings=part, provenance=origin, **columns)
            _require_sane(path, piece)
            yield piece


def _require_sane(path: Path, shard: Shard) -> None:
    bad = ~np.isfinite(shard.fine).all(axis=1) | ~np.isfinite(shard.coarse).all(axis=1)
    bad |= (shard.fine < 0).any(axis=1) | ~shard.fine.any(axis=1) | (shard.coarse <= 0).any(axis=1)
    bad |= ~np.isfinite(shard.residual) | (shard.residual < 0)
    if bad.any():
        raise UserError(
            f"{path}: sample {shard.start + int(bad.argmax())} holds moduli or residuals out of "
            f"range; generate the file again"
        )


def _require_consistent(paths: Sequence[str | Path], all_settings: Sequence[Settings]) -> None:
    first = all_settings[0]
    for path, settings in zip(paths, all_settings):
        for name, label in _OF_ONE_KIND.items():
            mine, expected = getattr(settings, name), getattr(first, name)
            if mine != expected:
                raise UserError(
                    f"{path}: fitted with {label} {mine}, but {paths[0]} with {expected}; "
                    "train on shards of one kind"
                )


def _require_disjoint(paths: Sequence[str | Path], all_settings: Sequence[Settings]) -> None:
    order = sorted(range(len(all_settings)), key=lambda i: _place(all_settings[i]))
    for before, after in zip(order, order[1:]):
        one, two = all_settings[before], all_settings[after]
        same = (one.seed, one.moduli) == (two.seed, two.moduli)
        if same and two.start < one.stop:
            raise UserError(
                f"{paths[after]}: samples {two.start}..{two.stop - 1} of seed {two.seed} overlap "
                f"{one.start}..{one.stop - 1} of {paths[before]}; list every sample once"
            )


def _place(settings: Settings) -> tuple[int, str, float, float, int]:
    drawn = settings.moduli
    return (settings.seed, drawn.distribution, drawn.low, drawn.high, settings.start)


def in_order(
    paths: Sequence[str | Path], all_settings: Sequence[Settings]
) -> list[tuple[str | Path, Settings]]:
    """Shards that belong together, ordered by seed, distribution and sample number.

    Raises UserError if there is none, objectives, Poisson's ratios or the code of the fits differ,
    or samples overlap.
    """
    if not paths:
        raise UserError("no dataset given, name at least one shard")
    _require_consistent(paths, all_settings)
    _require_disjoint(paths, all_settings)
    return sorted(zip(paths, all_settings), key=lambda pair: _place(pair[1]))
