"""Search for materials of groups of voxels: batches of changes that a linear model foretells.

The residuals of the cost are linearised in the changes, one a group at most. Changes are taken one
after the other, each the one that lowers the sum of squares of the linear model most given those
taken before, and their number is limited as steps of a trust region are: the batch is analysed,
taken if the cost is lower, and the limit follows from how well the model foretold it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array, Index
from carillon.errors import ConvergenceError
from carillon.fem.regions import RegionOf
from sound.building.voxel_solid import VoxelModes, VoxelSolid

FIRST_SHARE = 0.1
"""Share of the groups that change in the first batch at most."""
POOR, GOOD = 0.25, 0.75
"""Falls of the cost over the foretold ones below and above which the limit changes."""
NARROWER, WIDER = 0.4, 2.0
"""Factors of the limit then."""
PATIENCE = 24
"""Single changes in a row that lower the cost no more, after which the search is over."""
FEW = 8
"""Groups up to which every single change is tried before the search is over."""
ENOUGH = 1e-3
"""Share of the cost by which as many changes as the limit allows, all alike, lower it at least."""


@dataclass(frozen=True)
class FlipLimits:
    """Most `evaluations`, and what is called after each with the best so far; it ends the search
    by returning True."""

    evaluations: int
    watch: Callable[[VoxelModes], bool] | None = None


def improved(solid: VoxelSolid, start: VoxelModes, groups: Index, limits: FlipLimits) -> VoxelModes:
    """Materials of a lower cost than those of `start`, all voxels of a group (M,) alike.

    Where there are few groups, each change is tried by itself in the end, however little the model
    thinks of it. The result depends on nothing but the arguments.
    """
    best, end = start, solid.evaluations + limits.evaluations
    count = int(groups.max()) + 1
    is_few = count <= FEW
    patience = count * (len(solid.table) - 1) if is_few else PATIENCE
    limit, failed, model = max(1.0, FIRST_SHARE * count), set[int](), None
    while solid.evaluations < end and len(failed) < patience:
        if model is None:
            model = _LinearModel(solid, best, groups)
        most = max(1, int(limit))
        batch, foretold = model.batch(most, failed, is_few)
        if not len(batch):
            break
        tried = _tried(solid, best, _changed(best.numbers, groups, batch, len(solid.table)))
        fall = -np.inf if tried is None else best.cost.total - tried.cost.total
        if fall > 0.0:
            assert tried is not None
            best, model = tried, None
            failed.clear()
        elif len(batch) == 1:
            failed.add(int(batch[0]))
        if fall < POOR * foretold:
            limit = max(1.0, NARROWER * min(limit, len(batch)))
        elif fall > GOOD * foretold:
            limit = min(WIDER * limit, float(count))
        if limits.watch is not None and limits.watch(best):
            break
    return best


def _tried(solid: VoxelSolid, best: VoxelModes, numbers: RegionOf) -> VoxelModes | None:
    for start in (best.start, None):
        try:
            return solid.evaluate(numbers, start)
        except ConvergenceError:
            continue
    return None


def _changed(numbers: RegionOf, groups: Index, batch: Index, materials: int) -> RegionOf:
    changed = numbers.copy()
    for change in batch:
        changed[groups == change // materials] = change % materials
    return changed


class _LinearModel:
    """Residuals of the cost, linear in the changes."""

    def __init__(self, solid: VoxelSolid, at: VoxelModes, groups: Index) -> None:
        objective, weights = solid.objective, solid.objective.weights
        changes = solid.changes(at, groups)
        self._materials = len(solid.table)
        self._cost = at.cost.total
        by_frequency = objective.frequency_jacobian(at.values, changes)
        by_amplitude = objective.amplitude_jacobian(at.values, at.pushed, changes)
        factors = np.sqrt(weights.frequency), np.sqrt(weights.amplitude)
        self._residual = np.concatenate(
            [
                factors[0] * objective.frequency_residual(at.values),
                factors[1] * objective.amplitude_residual(at.values, at.pushed).ravel(),
            ]
        )
        self._rows: Array = np.concatenate(
            [
                factors[0] * by_frequency,
                factors[1] * by_amplitude.reshape(-1, by_frequency.shape[1]),
            ]
        )
        # What the groups are of already is no change.
        self._none = ~self._rows.any(axis=0)

    def batch(self, most: int, failed: set[int], any_single: bool) -> tuple[Index, float]:
        """At most so many changes, and by how much they lower the cost; none if none does.

        Those in `failed` are not taken. With `any_single`, a single one may raise the cost.
        """
        residual = self._residual.copy()
        gains = residual @ self._rows + 0.5 * (self._rows**2).sum(axis=0)
        gains[self._none] = np.inf
        gains[list(failed)] = np.inf
        taken: list[int] = []
        foretold = 0.0
        while len(taken) < most:
            best = int(np.argmin(gains))
            worthwhile = gains[best] < -ENOUGH * self._cost / max(1, most)
            if not (worthwhile or (any_single and not taken and np.isfinite(gains[best]))):
                break
            taken.append(best)
            foretold -= float(gains[best])
            gains += self._rows[:, best] @ self._rows
            group = best - best % self._materials
            gains[group : group + self._materials] = np.inf
        return np.array(taken, dtype=np.int64), max(foretold, 0.0)
