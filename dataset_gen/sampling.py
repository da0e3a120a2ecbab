"""Fine moduli to train on: hypercubes of 1,024 blocks, each made whole from its own counter.

Sample i depends on the seed and on i alone, however a range is split over jobs.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.random import Generator, Philox

from carillon.arrays import Array, Flags, Index
from carillon.errors import UserError
from carillon.fem.block import least_patterns, pattern_images, symmetries

DISTRIBUTIONS = {"uniform": (0.0, 10.0), "log-uniform": (0.01, 1000.0)}
"""Distributions of the fine moduli and their ranges in GPa unless told otherwise.

The paper's (section 8.1) is uniform in 0..10; log-uniform spans rubber to diamond.
"""
EXTREMES = (1e-9, 1e9)
"""Least and largest ends of a range in GPa, zero aside: what squares and products can bear."""
LARGEST_CONTRAST = 1e8
"""Most that the ends of a log-uniform range may differ: beyond, stiffness loses its digits."""
HYPERCUBE = 1024
"""Samples of one Latin hypercube."""
NEIGHBOURS = (1, 2, 4)
"""Cells adjacent to the origin of the ordering, cell 0 (section 7.1.1)."""


@dataclass(frozen=True)
class Moduli:
    """Where the fine moduli of filled cells are drawn from: a distribution on low..high [GPa].

    Hypercubes are Latin, means are taken and blocks blended on the distribution's own scale: the
    modulus itself if it is uniform, its logarithm if it is log-uniform.
    """

    distribution: str = "uniform"
    low: float = DISTRIBUTIONS["uniform"][0]
    high: float = DISTRIBUTIONS["uniform"][1]

    def validate(self) -> None:
        """Raise UserError unless the distribution is known and the range is possible."""
        if self.distribution not in DISTRIBUTIONS:
            raise UserError(
                f"distribution {self.distribution!r} is unknown, choose "
                f"{' or '.join(DISTRIBUTIONS)}"
            )
        smallest, largest = EXTREMES
        in_range = (self.low == 0.0 or self.low >= smallest) and smallest <= self.high <= largest
        if not (in_range and self.low < self.high):
            raise UserError(
                f"moduli from {self.low:g} to {self.high:g} GPa: expected low < high, high up to "
                f"{largest:g}, both {smallest:g} at least, or low 0"
            )
        if self.logarithmic and self.high > LARGEST_CONTRAST * self.low:
            raise UserError(
                f"log-uniform moduli from {self.low:g} to {self.high:g} GPa: expected low above 0 "
                f"and high up to {LARGEST_CONTRAST:g} times as large"
            )

    @property
    def logarithmic(self) -> bool:
        """Whether the scale is that of logarithms."""
        return self.distribution == "log-uniform"

    def spread(self, unit: Array) -> Array:
        """Numbers in 0..1 laid out over the range, on the distribution's scale."""
        low, high = self._ends()
        return np.asarray(low + (high - low) * unit)

    def soft_phase(self, stiff: Array, depth: Array, ratio: float) -> Array:
        """A second phase softer than `stiff`, by `depth` in 0..1 of the way down (own scale).

        The way ends at the range's lower end or, for uniform moduli, already at `stiff / ratio`.
        """
        low, _ = self._ends()
        if self.logarithmic:
            return stiff - depth * (stiff - low)
        furthest = np.minimum(ratio, stiff / low) if low > 0.0 else ratio
        return np.asarray(stiff * furthest**-depth)

    def values(self, place: Array) -> Array:
        """Moduli [GPa] from the distribution's scale, kept in range where rounding would leave."""
        return np.clip(np.exp(place) if self.logarithmic else place, self.low, self.high)

    def _ends(self) -> tuple[float, float]:
        if self.logarithmic:
            return float(np.log(self.low)), float(np.log(self.high))
        return self.low, self.high


def moduli(
    distribution: str = "uniform", low: float | None = None, high: float | None = None
) -> Moduli:
    """Validated `Moduli`; ends that are not given are those of the distribution.

    Raises UserError for an unknown distribution or an impossible range.
    """
    lowest, highest = DISTRIBUTIONS.get(distribution, (0.0, 1.0))
    drawn = Moduli(
        distribution,
        lowest if low is None else float(low),
        highest if high is None else float(high),
    )
    drawn.validate()
    return drawn


@dataclass(frozen=True)
class Mixture:
    """What the samples of a hypercube are made of.

    Means and contrasts are those of the scale of `Moduli`: arithmetic for uniform moduli, of
    logarithms for log-uniform ones.
    """

    void: float = 0.5
    """Share of blocks with at least one void cell (never all eight)."""
    uniform: float = 0.02
    """Share whose filled cells all have the mean of the block that was drawn."""
    two_phase: float = 0.13
    """Share with two values. Uniform: their ratio is log-uniform up to `phase_ratio`, or up to what
    the range allows. Log-uniform: the softer one is log-uniform between the range's lower end and
    the stiffer one."""
    blended: float = 0.35
    """Share pulled towards the block's mean, the contrast log-uniform down to `contrast`. The rest
    fills the hypercube as it is."""
    phase_ratio: float = 1e3
    contrast: float = 1e-3


@cache
def pattern_classes() -> list[Index]:
    """The 21 classes of the 255 fill patterns (bit masks) under the 48 symmetries; full is last."""
    least = pattern_images().min(axis=1)
    return [np.flatnonzero(least == representative) for representative in least_patterns()]


@cache
def _class_table() -> tuple[Index, Index]:
    """`pattern_classes` as one table, padded with zeros, and the size of each class."""
    classes = pattern_classes()
    sizes = np.array([len(masks) for masks in classes])
    table = np.zeros((len(classes), sizes.max()), dtype=np.int64)
    for row, masks in zip(table, classes):
        row[: len(masks)] = masks
    return table, sizes


def _latin_hypercube(generator: Generator) -> Array:
    columns = [generator.permutation(HYPERCUBE) for _ in range(8)]
    return np.asarray((np.stack(columns, axis=1) + generator.random((HYPERCUBE, 8))) / HYPERCUBE)


def _void_patterns(generator: Generator, share: float, uniform: Flags) -> Array:
    """Filled cells (1024, 8) as 0 and 1; uniform blocks run through all classes in turn."""
    classes = pattern_classes()
    partial = classes[:-1]
    chosen = np.full(HYPERCUBE, len(classes) - 1)
    void = generator.random(HYPERCUBE) < share
    chosen[void] = generator.integers(len(partial), size=void.sum())
    chosen[uniform] = np.arange(uniform.sum()) % len(classes)
    table, sizes = _class_table()
    member = (generator.random(HYPERCUBE) * sizes[chosen]).astype(int)
    masks = table[chosen, member]
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


def hypercube(
    seed: int, number: int, moduli: Moduli = Moduli(), mixture: Mixture = Mixture()
) -> Array:
    """All blocks (1024, 8) of hypercube `number`, in GPa."""
    generator = Generator(Philox(key=np.array([seed, number], dtype=np.uint64)))
    place = moduli.spread(_latin_hypercube(generator))
    shares = [mixture.uniform, mixture.two_phase, mixture.blended]
    kind = np.searchsorted(np.cumsum(shares), generator.permutation(HYPERCUBE) / HYPERCUBE, "right")
    mean = place.mean(axis=1, keepdims=True)
    contrast = mixture.contrast ** generator.random((HYPERCUBE, 1))
    stiff = place[:, :1]
    soft = moduli.soft_phase(stiff, generator.random((HYPERCUBE, 1)), mixture.phase_ratio)
    phases = np.where(generator.random((HYPERCUBE, 8)) < 0.5, soft, stiff)
    variants = [np.repeat(mean, 8, axis=1), phases, mean + contrast * (place - mean), place]
    young = moduli.values(np.choose(kind[:, None], variants))
    return orient(young * _void_patterns(generator, mixture.void, kind == 0))


def samples(
    seed: int, start: int, stop: int, moduli: Moduli = Moduli(), mixture: Mixture = Mixture()
) -> Array:
    """Blocks start..stop-1 (n, 8) of the endless sequence that belongs to `seed`, in GPa."""
    if seed < 0 or start < 0 or stop <= start:
        raise UserError(
            f"samples {start}..{stop} of seed {seed}: expected 0 <= start < stop and seed >= 0"
        )
    first, last = start // HYPERCUBE, (stop - 1) // HYPERCUBE
    rows = np.concatenate([hypercube(seed, n, moduli, mixture) for n in range(first, last + 1)])
    offset = first * HYPERCUBE
    return rows[start - offset : stop - offset]


def shard_range(total: int, shard: int, shards: int) -> tuple[int, int]:
    """First and past-the-last sample of one of `shards` nearly equal parts of 0..total-1.

    Raises UserError if the shard does not exist or would be empty.
    """
    if total < 1:
        raise UserError(f"{total} samples requested, expected at least 1")
    if shards < 1 or not 0 <= shard < shards:
        raise UserError(f"shard {shard} of {shards}: expected 0 <= shard < shards")
    if shards > total:
        raise UserError(f"{shards} shards for {total} samples: some would be empty, use fewer")
    return total * shard // shards, total * (shard + 1) // shards
