"""Fitted samples as the training sees them: numbered through all shards, read in pieces.

A sample's position in the dataset depends on its seed, distribution and number, not on the shards
that it was split over. So what is held out, and what the splits are chosen from, does not either.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from carillon.arrays import Array, Flags, Index
from dataset_gen.sampling import HYPERCUBE
from dataset_gen.settings import Settings
from dataset_gen.shards import PIECE_ROWS, Shard, in_order, iterate_shard, read_settings
from forests.scaling import TRANSFORMS, Features, prepare
from forests.training.structure import Rows

HELD_OUT = 20
"""Every so many-th sample is not trained on but scores the model..."""
MOST_HELD_OUT = 100_000
"""...up to so many."""
STUDIED = ("ratio-log", "bounded")
"""Transforms that can be trained to compare them, but not evaluated: the paper's ratios r with the
logarithm of the target, and r brought to -1..1 as (r - 1) / (r + 1) with the same target."""


class Samples(NamedTuple):
    """Blocks (n, 8), their fitted moduli (n, 8) and their positions (n,) in the dataset."""

    young: Array
    moduli: Array
    position: Index

    def where(self, chosen: Flags) -> Samples:
        """The chosen (n,) ones."""
        return Samples(self.young[chosen], self.moduli[chosen], self.position[chosen])


Reader = Callable[[int, int], Iterator[Shard]]
"""Pieces of one shard from one of its samples up to another, both counted from its start."""


@dataclass(frozen=True)
class Dataset:
    """Shards that belong together, in order; `first` (shards + 1,) are their first positions."""

    settings: tuple[Settings, ...]
    readers: tuple[Reader, ...]
    first: tuple[int, ...]

    @property
    def count(self) -> int:
        """Number of samples."""
        return self.first[-1]

    @property
    def objective(self) -> str:
        """Name of the fit objective."""
        return self.settings[0].objective

    @property
    def poisson(self) -> float:
        """Poisson's ratio of the fits."""
        return self.settings[0].poisson

    def read(self, begin: int, end: int) -> Iterator[Samples]:
        """Pieces of the converged samples at positions begin..end-1."""
        for number, reader in enumerate(self.readers):
            offset = self.first[number]
            start = max(begin, offset) - offset
            stop = min(end, self.first[number + 1]) - offset
            if start < stop:
                for piece in reader(start, stop):
                    position = np.arange(piece.start, piece.stop)
                    position += offset - self.settings[number].start
                    yield Samples(piece.fine, piece.coarse, position).where(piece.converged)

    def is_held_out(self, position: Index) -> Flags:
        """Which samples (n,) are not trained on: evenly spread, at most `MOST_HELD_OUT`."""
        every = max(HELD_OUT, -(-self.count // MOST_HELD_OUT))
        return np.asarray(position % every == every - 1)

    def training(self, begin: int, end: int) -> Iterator[Samples]:
        """Pieces of the samples at positions begin..end-1 that are trained on."""
        for piece in self.read(begin, end):
            yield piece.where(~self.is_held_out(piece.position))

    def subset(self, samples: int) -> Samples:
        """About so many of the samples that are trained on: whole hypercubes, evenly spread."""
        cubes = -(-self.count // HYPERCUBE)
        number = min(cubes, max(1, -(-samples // HYPERCUBE)))
        chosen = (np.arange(number) * cubes + cubes // 2) // number
        runs = np.split(chosen, np.flatnonzero(np.diff(chosen) > 1) + 1)
        bounds = [(run[0] * HYPERCUBE, (run[-1] + 1) * HYPERCUBE) for run in runs]
        return joined(piece for run in bounds for piece in self.training(*map(int, run)))

    def thinned(self, samples: int) -> Dataset:
        """About so many samples: the first ones of every shard, in proportion."""
        counts = [max(1, -(-part.count * samples // self.count)) for part in self.settings]
        pairs = zip(self.settings, counts, self.readers, strict=True)
        return _dataset(
            [(replace(part, stop=part.start + count), reader) for part, count, reader in pairs]
        )


def joined(pieces: Iterable[Samples]) -> Samples:
    """Several pieces as one."""
    nothing = Samples(np.empty((0, 8)), np.empty((0, 8)), np.empty(0, dtype=np.int64))
    young, moduli, position = zip(nothing, *pieces, strict=True)
    return Samples(np.concatenate(young), np.concatenate(moduli), np.concatenate(position))


def _dataset(ordered: Sequence[tuple[Settings, Reader]]) -> Dataset:
    first = np.cumsum([0] + [settings.count for settings, _ in ordered])
    return Dataset(
        tuple(settings for settings, _ in ordered),
        tuple(reader for _, reader in ordered),
        tuple(map(int, first)),
    )


def open_dataset(paths: Sequence[str | Path]) -> Dataset:
    """The shards at `paths`, each checked whole, as one dataset.

    Raises UserError if there is none, one is missing or damaged, or they do not belong together.
    """
    all_settings = [read_settings(path) for path in paths]
    return _dataset(
        [(settings, _reader_of(path)) for path, settings in in_order(paths, all_settings)]
    )


def _reader_of(path: str | Path) -> Reader:
    return lambda first, past: iterate_shard(path, PIECE_ROWS, first, past)


def dataset_of(shards: Sequence[Shard]) -> Dataset:
    """Shards in memory as one dataset.

    Raises UserError if there is none or they do not belong together.
    """
    names = [f"shard {number}" for number in range(len(shards))]
    ordered = in_order(names, [shard.settings for shard in shards])
    by_name = dict(zip(names, shards, strict=True))
    return _dataset([(settings, partial(_slices, by_name[str(n)])) for n, settings in ordered])


def _slices(shard: Shard, first: int, past: int) -> Iterator[Shard]:
    for begin in range(first, past, PIECE_ROWS):
        yield shard.part(begin, min(begin + PIECE_ROWS, past))


def is_uniform(young: Array) -> Flags:
    """Whether all filled cells of each block (n, 8) are equal; shape (n,)."""
    return np.asarray(young.max(axis=1) == np.where(young > 0, young, np.inf).min(axis=1))


def modulus_over_scale(target: Array, transform: str) -> Array:
    """Ratios E / scale from what the trees learn."""
    return target if transform == "ratio" else np.exp(target)


def _transformed(features: Features, transform: str) -> Features:
    if transform != "bounded":
        return features
    ratio = features.astype(float)
    return np.asarray(((ratio - 1.0) / (ratio + 1.0)).astype(np.float32))


def rows_of(samples: Samples, transform: str, uniform_weight: float = 1.0) -> tuple[Rows, Rows]:
    """Rows with a void and with a filled origin."""
    prepared = prepare(samples.young, transform if transform in TRANSFORMS else "ratio")
    ratios = samples.moduli / prepared.scale
    target = ratios if transform == "ratio" else np.log(ratios)
    weight = np.where(is_uniform(samples.young), uniform_weight, 1.0)
    weight = np.broadcast_to(weight[:, None], target.shape)
    void, filled = (
        Rows(
            _transformed(prepared.features[kind], transform),
            prepared.pattern[kind],
            target[kind],
            weight[kind],
        )
        for kind in (~prepared.filled, prepared.filled)
    )
    return void, filled
