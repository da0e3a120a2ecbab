"""A space of heads: blends of measured heads, spanned by the components in which they differ most.

A blend is a sum of the heads' log magnitudes and delays with weights that sum to 1.  Of many heads
such weights are more numbers than a listener can answer for, so a point of the space has one
coordinate for each of the first principal components, in which the heads vary most audibly; its
weights follow from it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError
from sound.heads.measured_head import MeasuredHead, read_head

COMPONENTS = 10
"""Most principal components: 120 comparisons determine about as many numbers."""
BANDS = (500.0, 16_000.0, 20)
"""Lowest and highest frequency [Hz] that heads are compared in, and the number of bands between."""
ALIKE = 1e-6
"""Difference of heads [dB] below which they are one: that of the rounding of equal ones."""
DELAY_WEIGHT = 1.0 / 20e-6
"""Difference of levels [dB] as audible as a difference of delays of 1 s: 1 dB and 20 us are both
about just noticeable (Mills 1958)."""
SUFFIX = ".sofa"


@dataclass(frozen=True)
class HeadSpace:
    """Heads of the same directions and rate, and the space that their blends span."""

    heads: Sequence[MeasuredHead]

    @property
    def titles(self) -> list[str]:
        """What the heads are called."""
        return [head.title for head in self.heads]

    @cached_property
    def features(self) -> Array:
        """Features (S, D) [dB] of the heads, see `features_of`."""
        return np.stack([features_of(head) for head in self.heads])

    @cached_property
    def _components(self) -> tuple[Array, Array, Array]:
        mean = self.features.mean(axis=0)
        left, values, _ = np.linalg.svd(self.features - mean, full_matrices=False)
        least = max(1e-9 * values[0], ALIKE)
        count = min(COMPONENTS, int(np.count_nonzero(values > least)))
        # The sign of a component is a matter of the library's; the first head decides it here.
        signs = np.where(left[0, :count] < 0.0, -1.0, 1.0)
        return left[:, :count] * signs, values[:count], mean

    @property
    def dimensions(self) -> int:
        """Number K of coordinates."""
        return len(self._components[1])

    @property
    def coordinates(self) -> Array:
        """Points (S, K) of the heads, in standard deviations of each component."""
        return self._components[0] * np.sqrt(len(self.heads))

    @property
    def scales(self) -> Array:
        """Standard deviations (K,) [dB] of the components, the largest first."""
        return self._components[1] / np.sqrt(len(self.heads))

    def weights(self, point: Array) -> Array:
        """Weights (S,) of the heads, which sum to 1, at a point (K,)."""
        count = len(self.heads)
        return 1.0 / count + self._components[0] @ point / np.sqrt(count)

    def blend(self, weights: Array, title: str = "blend") -> MeasuredHead:
        """The head of the log magnitudes and delays of all heads, summed with weights (S,)."""
        first = self.heads[0]
        # One after the other: all together may fill the memory.
        levels = np.zeros(first.log_magnitudes.shape)
        for weight, head in zip(weights, self.heads):
            levels += weight * head.log_magnitudes
        delays = np.tensordot(weights, np.stack([head.delays for head in self.heads]), 1)
        log_magnitudes = levels.astype(np.float32)
        return replace(first, title=title, log_magnitudes=log_magnitudes, delays=delays)

    def features_at(self, point: Array) -> Array:
        """Features (D,) [dB] of the blend at a point (K,)."""
        return np.asarray(self.weights(point) @ self.features)


def features_of(head: MeasuredHead) -> Array:
    """Features (D,) [dB] of a head, whose Euclidean distance tells how differently heads sound.

    They are levels in bands and delays in units that are as audible, all directions and both ears
    alike: the distance of two heads is the root of their mean square differences.
    """
    low, high, count = BANDS
    edges = np.geomspace(low, min(high, 0.45 * head.rate), count + 1)
    grid = 2 * (head.log_magnitudes.shape[2] - 1)
    at = np.round(edges * grid / head.rate).astype(int)
    decibels = head.log_magnitudes * (20.0 / np.log(10.0))
    bands = [
        decibels[:, :, first : max(last, first + 1)].mean(axis=2, dtype=float)
        for first, last in zip(at, at[1:])
    ]
    levels, delays = np.stack(bands), DELAY_WEIGHT * head.delays
    return np.concatenate([levels.ravel() / levels.size**0.5, delays.ravel() / delays.size**0.5])


def distance(first: MeasuredHead, second: MeasuredHead) -> float:
    """How differently two heads of the same directions sound [dB]."""
    return float(np.linalg.norm(features_of(first) - features_of(second)))


def read_heads(
    folder: str | Path, rate: float | None = None, tell: Callable[[str], None] | None = None
) -> HeadSpace:
    """The heads of a folder, sorted by the names of their files.

    All have the rate [Hz], or that of the first one, and the directions of the first one, in which
    others are interpolated.  `tell` is called with the name of each file.  Raises UserError if
    there are none, or one is unusable.
    """
    paths = head_files(folder)
    if not paths:
        raise UserError(f"{folder}: has no measured heads (*{SUFFIX}); name another folder")
    heads: list[MeasuredHead] = []
    for path in paths:
        if tell is not None:
            tell(path.name)
        head = replace(read_head(path, heads[0].rate if heads else rate), title=path.stem)
        heads.append(_in_directions(head, heads[0]) if heads else head)
    return HeadSpace(heads)


def head_files(folder: str | Path) -> list[Path]:
    """SOFA files of a folder, sorted by name.  Raises UserError if there is no such folder."""
    folder = Path(folder)
    if not folder.is_dir():
        raise UserError(f"{folder}: no such folder, expected one of measured heads (*{SUFFIX})")
    return sorted(path for path in folder.iterdir() if path.suffix.lower() == SUFFIX)


def _in_directions(head: MeasuredHead, of: MeasuredHead) -> MeasuredHead:
    """A head in the directions of another one."""
    same = head.directions.shape == of.directions.shape
    if same and np.allclose(head.directions, of.directions, atol=1e-6):
        return replace(head, mesh=of.mesh)
    corners, weights, _ = head.mesh.weights(of.directions)
    levels = np.einsum("mk,mkef->mef", weights.astype(np.float32), head.log_magnitudes[corners])
    delays = np.einsum("mk,mke->me", weights, head.delays[corners])
    return replace(head, mesh=of.mesh, log_magnitudes=levels, delays=delays)
