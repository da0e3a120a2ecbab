"""Which modes of a solid stand for which partials of its clips.

A solid has its modes one after the other, a clip its partials with gaps.  So modes between
partials stay silent: they are to be pushed little where the solid is struck, at whatever frequency,
and to die away at once.  Partials and modes are matched in their order, by dynamic programming, so
that loud partials find modes near to them which the strikes push.
"""

from dataclasses import dataclass, replace

import numpy as np

from carillon.arrays import Array, Flags, Index
from solver.subspace.weyl import clusters
from sound.clips.audibility import BURST_DAMPING, BURST_QUALITY
from sound.clips.targets import Targets

FAR = 0.25
"""Distance [nepers] of a mode from its partial that costs as much as leaving the partial out: four
semitones, which a material moves a mode by easily."""
QUIET, _SILENT = 20.0, 60.0
"""Level [dB] of a mode's push below the strongest from which on it costs to take a partial, and at
which it costs as much as leaving that out."""
LOUD_SILENT = 0.02
"""Cost of a mode without a partial that the strikes push as much as any."""
DEEPER = 0.002
"""Cost of each mode, since modes take time."""
TWIN = 3e-3
"""Relative distance of modes of one frequency, such as the pairs of round solids."""
PUSHED = 0.1
"""Least push of another mode of the frequency, over that of the strongest, that takes a partial."""


@dataclass(frozen=True)
class SolidSpectrum:
    """Frequencies (M,) [Hz], ascending, of a solid's elastic modes, and how strongly its struck
    points push them, (T, M)."""

    hertz: Array
    pushed: Array


def assigned(targets: Targets, shares: Array, solid: SolidSpectrum) -> Targets:
    """Targets for the modes of a solid that come nearest to some partials; others are silent.

    Each of the lowest modes gets a partial or stays silent; partials that none can have are left
    out.  Modes of one frequency share a partial as far as the strikes push them in different ways:
    one strike pushes one mode of a pair, and the other one is free to go elsewhere.  `shares` (N,)
    are those of the partials in the loudness of the clips.
    """
    groups = [slice(each.start, each.stop) for each in clusters(solid.hertz**2, 2.0 * TWIN)]
    firsts = [each.start for each in groups]
    push = np.sqrt(np.add.reduceat((solid.pushed**2).sum(axis=0), firsts))
    pairs = _pairs(np.log(targets.frequencies), shares, np.log(solid.hertz[firsts]), push)
    # Differences and balances need two modes.
    count = max(2, groups[pairs[-1, 1]].stop)
    partial = np.full(count, -1)
    amplitudes = np.zeros((len(targets.names), count))
    for own, group in pairs:
        first = firsts[group]
        partial[first : first + _pushed_apart(solid.pushed[:, groups[group]])] = own
        amplitudes[:, firsts[group]] = targets.amplitudes[:, own]
    silent = partial < 0
    left_out = np.setdiff1d(np.arange(len(shares)), pairs[:, 0])
    hertz = placed(solid.hertz[:count], targets.frequencies[partial], silent)
    return replace(
        targets,
        frequencies=hertz,
        dampings=np.where(silent, _quick(hertz, targets.dampings), targets.dampings[partial]),
        amplitudes=amplitudes,
        silent=silent,
        left_out=targets.frequencies[left_out],
        left_out_share=float(shares[left_out].sum()),
    )


def _pushed_apart(pushed: Array) -> int:
    """Number of modes of one frequency, by some basis of these, that strikes (T, n) push."""
    values = np.linalg.svd(pushed, compute_uv=False)
    return max(1, int((values > PUSHED * values[0]).sum()))


def _quick(hertz: Array, dampings: Array) -> Array:
    """Dampings (M,) [1/s] of silent modes: those of bursts, quicker than all partials."""
    burst = np.minimum(BURST_DAMPING, np.pi * hertz / BURST_QUALITY)
    return np.asarray(np.maximum(burst, dampings.max()))


def placed(solid: Array, targets: Array, silent: Flags) -> Array:
    """Frequencies (M,) [Hz] of targets, with silent ones where the solid's (M,) put them.

    Between two partials silent modes divide the way as those of the solid do.

    Examples
    --------
    >>> solid, silent = np.array([100.0, 200.0, 400.0]), np.array([False, True, False])
    >>> placed(solid, np.array([440.0, 0.0, 1760.0]), silent).round(6).tolist()
    [440.0, 880.0, 1760.0]
    """
    at = np.flatnonzero(~silent)
    log, aims = np.log(solid), np.log(targets[at])
    moved = log + np.interp(log, log[at], aims - log[at])
    return np.where(silent, np.exp(moved), targets)


def _pairs(partials: Array, shares: Array, modes: Array, push: Array) -> Index:
    """Numbers (p, 2) of partials and of their modes, both ascending, of least cost.

    Both are logarithms of frequencies; the strikes push each mode by `push` (M,).
    """
    level = 20.0 * np.log10(np.maximum(push / push.max(), 1e-6))
    weak = np.clip((-level - QUIET) / (_SILENT - QUIET), 0.0, 1.0)
    passed = DEEPER + LOUD_SILENT * 10.0 ** (level / 20.0)
    least, pairs = np.inf, np.empty((0, 2), dtype=np.int64)
    for scale in np.unique(np.round(partials[:, None] - modes[None, :], 3)):
        off = (partials[:, None] - scale - modes[None, :]) / FAR
        costs = shares[:, None] * (np.minimum(off**2, 4.0) + weak)
        cost, found = _matching(costs, shares, passed)
        if cost < least:
            least, pairs = cost, found
    return pairs


def _matching(costs: Array, left_out: Array, passed: Array) -> tuple[float, Index]:
    """The least cost of pairs in order, and these (p, 2); at least one pair is made.

    `costs` (N, M) of pairs, `left_out` (N,) of partials without a mode, `passed` (M,) of modes
    below the last pair without a partial.
    """
    count, depth = costs.shape
    least = np.full((count + 1, depth + 1), np.inf)
    least[:, 0] = np.concatenate([[0.0], left_out.cumsum()])
    least[0] = np.concatenate([[0.0], passed.cumsum()])
    for i in range(1, count + 1):
        for j in range(1, depth + 1):
            least[i, j] = min(
                least[i - 1, j - 1] + costs[i - 1, j - 1],
                least[i - 1, j] + left_out[i - 1],
                least[i, j - 1] + passed[j - 1],
            )
    # Modes beyond the last pair are not there.
    tails = np.concatenate([left_out[::-1].cumsum()[::-1], [0.0]])
    ends = least[:-1, :-1] + costs + tails[1:, None]
    i, j = divmod(int(np.argmin(ends)), depth)
    total, pairs = float(ends[i, j]), [(i, j)]
    while i > 0 and j > 0:
        if least[i, j] == least[i - 1, j - 1] + costs[i - 1, j - 1]:
            i, j = i - 1, j - 1
            pairs.append((i, j))
        elif least[i, j] == least[i - 1, j] + left_out[i - 1]:
            i -= 1
        else:
            j -= 1
    return total, np.array(pairs[::-1])
