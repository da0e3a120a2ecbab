"""Fitted samples as the training sees them: numbered in one row, read or made in pieces.

A sample's position in the dataset depends on its seed, distribution and number, not on the shards
that it was split over, nor on whether there are any. So what is held out, and what the splits are
chosen from, does not either.
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
from dataset_gen.shards import Shard, in_order, read_runs, read_settings, shard_of
from dataset_gen.tasks import TASK_ROWS, ShardPlan
from dataset_gen.tasks import rows_of as rows_of_task
from forests.scaling import TRANSFORMS, Features, prepare
from forests.training.structure import Rows

BLOCK_CUBES = 16
"""Hypercubes that are read or made together."""
BLOCK = BLOCK_CUBES * HYPERCUBE
"""Samples of a block."""
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

    def where(self, chosen: Flags | Index) -> Samples:
        """The chosen ones: flags (n,), or numbers."""
        return Samples(self.young[chosen], self.moduli[chosen], self.position[chosen])


Run = tuple[int, int]
"""First and past-the-last of samples that follow on each other."""
Reader = Callable[[Sequence[Run]], Iterator[Shard]]
"""Pieces of runs of samples of one shard, in order; the samples are counted from its start."""


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

    def read(self, runs: Sequence[Run]) -> Iterator[Samples]:
        """Pieces of the converged samples at positions of ascending runs, in order."""
        for number, reader in enumerate(self.readers):
            first, past = self.first[number : number + 2]
            own = [(max(begin, first) - first, min(end, past) - first) for begin, end in runs]
            own = [(begin, end) for begin, end in own if begin < end]
            for piece in reader(own) if own else ():
                position = np.arange(piece.start, piece.stop)
                position += first - self.settings[number].start
                yield Samples(piece.fine, piece.coarse, position).where(piece.converged)

    def is_held_out(self, position: Index) -> Flags:
        """Which samples (n,) are not trained on: evenly spread, at most `MOST_HELD_OUT`."""
        every = max(HELD_OUT, -(-self.count // MOST_HELD_OUT))
        return np.asarray(position % every == every - 1)

    def learned(self, runs: Sequence[Run]) -> Samples:
        """The samples at positions of ascending runs that are trained on."""
        return joined(piece.where(~self.is_held_out(piece.position)) for piece in self.read(runs))

    def spread(self, samples: int) -> list[list[Run]]:
        """Runs of about so many samples, evenly spread: whole hypercubes, some to a block."""
        cubes = -(-self.count // HYPERCUBE)
        number = min(cubes, max(1, -(-samples // HYPERCUBE)))
        whole, rest = divmod(cubes, number)
        chosen = np.arange(number) * whole + (np.arange(number) * rest + cubes // 2) // number
        return [
            [(run[0] * HYPERCUBE, (run[-1] + 1) * HYPERCUBE) for run in _consecutive(block)]
            for block in np.split(chosen, range(BLOCK_CUBES, number, BLOCK_CUBES))
        ]

    def blocks(self, first: int = 0) -> range:
        """First positions of blocks of `BLOCK` samples from a position on, see `run_of`."""
        return range(first, self.count, BLOCK)

    def run_of(self, block: int) -> Run:
        """The samples of a block; the last one may have fewer."""
        return block, min(block + BLOCK, self.count)

    def subset(self, samples: int) -> Samples:
        """About so many of the samples that are trained on, evenly spread."""
        return joined(self.learned(runs) for runs in self.spread(samples))

    def thinned(self, samples: int) -> Dataset:
        """About so many samples: the first ones of every shard, in proportion."""
        counts = [max(1, -(-part.count * samples // self.count)) for part in self.settings]
        pairs = zip(self.settings, counts, self.readers, strict=True)
        return _dataset(
            [(replace(part, stop=part.start + count), reader) for part, count, reader in pairs]
        )


def _consecutive(numbers: Index) -> list[list[int]]:
    runs = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)
    return [[int(number) for number in run] for run in runs]


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


def open_dataset(paths: Sequence[str | Path], own: slice = slice(None)) -> Dataset:
    """The shards at `paths` as one dataset.

    `own`: those whose bytes are checked against their checksums, once; all, unless ranks share
    them, or another job of the same run does it. What is read of the others is still checked piece
    by piece, as HDF5 stores checksums too. Raises UserError if there is none, one is missing or
    damaged, or they do not belong together.
    """
    for path in paths[own]:
        read_settings(path)
    all_settings = [read_settings(path, checked=True) for path in paths]
    return _dataset(
        [(settings, partial(read_runs, path)) for path, settings in in_order(paths, all_settings)]
    )


def made_dataset(parts: Sequence[Settings]) -> Dataset:
    """Samples that are drawn and fitted where they are used, and never stored.

    Raises UserError if the parts do not belong together.
    """
    names = [f"part {number}" for number in range(len(parts))]
    return _dataset([(part, partial(_made, part)) for _, part in in_order(names, parts)])


def _made(settings: Settings, runs: Sequence[Run]) -> Iterator[Shard]:
    for first, past in runs:
        for begin in range(settings.start + first, settings.start + past, TASK_ROWS):
            end = min(begin + TASK_ROWS, settings.start + past)
            part = replace(settings, start=begin, stop=end)
            yield shard_of(part, rows_of_task(ShardPlan(part).work(0)), {})


def dataset_of(shards: Sequence[Shard]) -> Dataset:
    """Shards in memory as one dataset.

    Raises UserError if there is none or they do not belong together.
    """
    names = [f"shard {number}" for number in range(len(shards))]
    ordered = in_order(names, [shard.settings for shard in shards])
    by_name = dict(zip(names, shards, strict=True))
    return _dataset([(settings, partial(_parts, by_name[str(n)])) for n, settings in ordered])


def _parts(shard: Shard, runs: Sequence[Run]) -> Iterator[Shard]:
    return (shard.part(begin, end) for begin, end in runs)


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
