"""Random blocks that the coarsenings are compared on (section 8.1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.fem.block import void_patterns
from dataset_gen.objectives import orientations
from dataset_gen.sampling import Mixture, Moduli, moduli, samples

FIRST_SEED = 2**63
"""Samples of the comparison have seeds from here on, which training data do not have."""

STREAMS = 16
"""Sequences of samples that belong to one seed of the comparison."""


@dataclass(frozen=True)
class BlockCase:
    """A distribution of blocks."""

    low: float
    high: float
    """Range of the moduli of filled cells [GPa], before scaling."""
    distribution: str
    """"uniform" or "log-uniform", cells independent."""
    void: bool
    """Whether every block has void cells, of a pattern drawn by class as in training data; else
    none has."""
    stream: int
    """Number of the sequence of samples; cases of one stream have the same blocks."""
    scaled_by: float = 1.0
    """Factor on all moduli."""

    @property
    def fill(self) -> str:
        """Whether blocks are solid, in words."""
        return "partly void" if self.void else "solid"

    @property
    def range_gpa(self) -> tuple[float, float]:
        """Range of the moduli after scaling."""
        return self.low * self.scaled_by, self.high * self.scaled_by

    @property
    def moduli(self) -> Moduli:
        """Distribution of the moduli before scaling."""
        return moduli(self.distribution, self.low, self.high)

    def alike(self, other: BlockCase) -> bool:
        """Whether blocks of both cases differ in nothing but the range of their moduli."""
        return (self.distribution, self.void) == (other.distribution, other.void)

    @property
    def name(self) -> str:
        """Range, distribution, fill and scale in words."""
        low, high = self.range_gpa
        scaled = ""
        if self.scaled_by != 1.0:
            scaled = f" (the blocks of {self.low:g}..{self.high:g} GPa times {self.scaled_by:g})"
        return f"{low:g}..{high:g} GPa {self.distribution}, {self.fill}{scaled}"

    def blocks(self, count: int, seed: int) -> Array:
        """Fine moduli (count, 8) [GPa], turned so that 21 void patterns stand for all."""
        mixture = Mixture(void=float(self.void), uniform=0.0, two_phase=0.0, blended=0.0)
        number = FIRST_SEED + STREAMS * seed + self.stream
        return turned(samples(number, 0, count, self.moduli, mixture)) * self.scaled_by

    def columns(self) -> dict[str, Any]:
        """What a row of the table says of its blocks."""
        return {
            "range_gpa": list(self.range_gpa),
            "distribution": self.distribution,
            "fill": self.fill,
            "scaled_by": self.scaled_by,
        }


CASES = (
    BlockCase(0.0, 10.0, "uniform", void=False, stream=0),
    BlockCase(100.0, 10_000.0, "uniform", void=False, stream=1),
    BlockCase(0.01, 1000.0, "log-uniform", void=False, stream=2),
    BlockCase(0.0, 10.0, "uniform", void=True, stream=3),
    BlockCase(0.0, 10.0, "uniform", void=False, stream=0, scaled_by=1000.0),
)
"""The paper's trained range and its untrained one; rubber to diamond; partly void; scaled."""


def turned(young: Array) -> Array:
    """Blocks (n, 8), each turned by a symmetry of the cube to the least image of its pattern."""
    turn = orientations()[1][void_patterns(young)]
    images = np.empty_like(young)
    np.put_along_axis(images, turn, young, axis=1)
    return images
