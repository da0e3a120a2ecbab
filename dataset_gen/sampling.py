"""Fine moduli to train on: hypercubes of 1,024 blocks, each made whole from its own counter.

Sample i depends on the seed and on i alone, however a range is split over jobs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.random import Generator, Philox
from numpy.typing import NDArray

from carillon.errors import UserError
from dataset_gen.block import symmetries
from dataset_gen.element import Array

YOUNG_MAX = 10.0
"""Upper end of the sampled moduli in GPa (paper, section 8.1)."""

HYPERCUBE = 1024
"""Samples of one Latin hypercube."""

NEIGHBOURS = (1, 2, 4)
"""Cells adjacent to the origin of the ordering, cell 0 (section 7.1.1)."""


@dataclass(frozen=True)
class Mixture:
    """What the samples of a hypercube are made of.

    Attributes
    ----------
    void : share of blocks with at least one void cell (never all eight).
    uniform : share whose filled cells are all equal.
    two_phase : share with two values, their ratio log-uniform up to `phase_ratio`.
    blended : share pulled towards the block's mean, the contrast log-uniform down to `contrast`.
        The rest fills the hypercube as it is.
    """

    void: float = 0.5
    uniform: float = 0.02
    two_phase: float = 0.13
    blended: float = 0.35
    phase_ratio: float = 1e3
    contrast: float = 1e-3


@cache
def pattern_classes() -> list[NDArray[np.int64]]:
    """The 21 classes of the 255 fill patterns (bit masks) under the 48 symmetries; full is last."""
    bits = 1 << symmetries()
    masks = np.arange(1, 256)
    filled = (masks[:, None] >> np.arange(8) & 1).astype(bool)
    least = np.where(filled[:, None], bits[None], 0).sum(axis=2).min(axis=1)
    return [masks[least == representative] for representative in np.unique(least)]


def _latin_hypercube(generator: Generator) -> Array:
    columns = [generator.permutation(HYPERCUBE) for _ in range(8)]
    return np.asarray((np.stack(columns, axis=1) + generator.random((HYPERCUBE, 8))) / HYPERCUBE)


def _void_patterns(generator: Generator, share: float, uniform: NDArray[np.bool_]) -> Array:
    """Filled cells (1024, 8) as 0 and 1; uniform blocks run through all classes in turn."""
    classes = pattern_classes()
    partial = classes[:-1]
    chosen = np.full(HYPERCUBE, len(classes) - 1)
    void = generator.random(HYPERCUBE) < share
    chosen[void] = generator.integers(len(partial), size=void.sum())
    chosen[uniform] = np.arange(uniform.sum()) % len(classes)
    member = generator.random(HYPERCUBE)
    masks = np.array([classes[c][int(m * len(classes[c]))] for c, m in zip(chosen, member)])
    return (masks[:, None] >> np.arange(8) & 1).astype(float)


def orient(young: Array) -> Array:
    """Swap axes so that the origin's neighbours are ordered: e[1] <= e[2] <= e[4] (e'2..e'4).

    A symmetry of the cube does it, so the block stays the same block.
    """
    corner = symmetries()[symmetries()[:, 0] == 0]
    candidates = young[:, np.argsort(corner, axis=1)]
    keys = candidates[..., list(NEIGHBOURS)]
    ordered = (keys[..., 0] <= keys[..., 1]) & (keys[..., 1] <= keys[..., 2])
    return np.asarray(candidates[np.arange(len(young)), ordered.argmax(axis=1)])


def hypercube(seed: int, number: int, mixture: Mixture = Mixture()) -> Array:
    """All blocks (1024, 8) of hypercube `number`, in GPa."""
    generator = Generator(Philox(key=np.array([seed, number], dtype=np.uint64)))
    young = YOUNG_MAX * _latin_hypercube(generator)
    shares = [mixture.uniform, mixture.two_phase, mixture.blended]
    kind = np.searchsorted(np.cumsum(shares), generator.permutation(HYPERCUBE) / HYPERCUBE, "right")
    mean = young.mean(axis=1, keepdims=True)
    contrast = mixture.contrast ** generator.random((HYPERCUBE, 1))
    ratio = mixture.phase_ratio ** -generator.random((HYPERCUBE, 1))
    soft = generator.random((HYPERCUBE, 8)) < 0.5
    phases = young[:, :1] * np.where(soft, ratio, 1.0)
    variants = [np.repeat(mean, 8, axis=1), phases, mean + contrast * (young - mean), young]
    young = np.choose(kind[:, None], variants)
    return orient(young * _void_patterns(generator, mixture.void, kind == 0))


def samples(seed: int, start: int, stop: int, mixture: Mixture = Mixture()) -> Array:
    """Blocks start..stop-1 (n, 8) of the endless sequence that belongs to `seed`, in GPa."""
    if seed < 0 or start < 0 or stop <= start:
        raise UserError(
            f"samples {start}..{stop} of seed {seed}: expected 0 <= start < stop and seed >= 0"
        )
    first, last = start // HYPERCUBE, (stop - 1) // HYPERCUBE
    rows = np.concatenate([hypercube(seed, n, mixture) for n in range(first, last + 1)])
    offset = first * HYPERCUBE
    return rows[start - offset : stop - offset]


def shard_range(total: int, shard: int, shards: int) -> tuple[int, int]:
    """First and past-the-last sample of one of `shards` nearly equal parts of 0..total-1.

    Raises
    ------
    UserError
        If the shard does not exist or would be empty.
    """
    if total < 1:
        raise UserError(f"{total} samples requested, expected at least 1")
    if shards < 1 or not 0 <= shard < shards:
        raise UserError(f"shard {shard} of {shards}: expected 0 <= shard < shards")
    if shards > total:
        raise UserError(f"{shards} shards for {total} samples: some would be empty, use fewer")
    return total * shard // shards, total * (shard + 1) // shards
