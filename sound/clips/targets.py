"""Targets of a design: the modes of several clips, brought to one list of frequencies."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index
from carillon.command_line.counts import counted
from carillon.errors import UserError
from sound.clips.audibility import heard_partials, loudness_shares
from sound.clips.extraction import ModalSound
from sound.clips.noise import noise_part
from sound.levels import faded

SAME_HERTZ, SAME_FRACTION = 1.0, 0.002
"""Greatest distance of modes of different clips that count as one, in Hz or as a share, whichever
is more: about the least difference of pure tones that listeners hear (Moore, An Introduction to the
Psychology of Hearing, ch. 6).
"""
APART = 3e-3
"""Greatest relative difference of two frequencies that count as one mode of a design, as it
averages their amplitudes, see `sound.design.resolved.RESOLVED`."""
HEARD = 1e-3
"""Least amplitude of an audible mode, over that of the clip's loudest (-60 dB)."""
MOST_MODES = 30
"""Greatest number of partials of a design whose project leaves the number to the clips."""


@dataclass(frozen=True)
class ClipLoudness:
    """Integrated loudness `lufs` (T,) [LUFS] of clips over `seconds` (T,), from strike to end, of
    30 s at most.

    It includes strikes that are left out and fade-outs, and does without the absolute gate of ITU-R
    BS.1770, see `sound.levels.relative_loudness`.
    """

    lufs: Array
    seconds: Array


@dataclass(frozen=True)
class Targets:
    """Modes that a design should have at T struck points of some names.

    Ascending frequencies (N,) [Hz] and dampings (N,) [1/s] are shared by all points; amplitudes (T,
    N) are those at the strike, 0 where the clip of a point lacks a mode.  `residuals` are T arrays
    (s,), each clip without its modes, and `rates` [Hz] their sampling rates.  The `loudness` of the
    clips is None if it is not known.  Modes that are `silent` (N,), none if None, are partials of
    no clip: they lie between partials, and shall not sound, wherever their frequencies come to be.
    Partials that no mode of the solid has are `left_out` (q,) [Hz], with their share in the
    loudness of the clips.
    """

    names: tuple[str, ...]
    frequencies: Array
    dampings: Array
    amplitudes: Array
    residuals: tuple[Array, ...]
    rates: tuple[int, ...]
    loudness: ClipLoudness | None = None
    silent: Flags | None = None
    left_out: Array | None = None
    left_out_share: float = 0.0

    @property
    def sounding(self) -> Index:
        """Numbers (p,) of the modes that are partials of a clip."""
        if self.silent is None:
            return np.arange(len(self.frequencies))
        return np.flatnonzero(~self.silent)

    @property
    def shares(self) -> Array:
        """Shares (N,) of the modes in the loudness of the clips, the mean over these."""
        of_clips = [
            loudness_shares(self.frequencies, self.dampings, row)
            for row in self.amplitudes
            if row.any()
        ]
        return np.asarray(np.mean(of_clips, axis=0))

    @cached_property
    def noises(self) -> tuple[tuple[Array, float], ...]:
        """Noise (s,) of each residual, which fades where it is cut off, and the share of the
        residual's energy in tones, which is left out; see `sound.clips.noise`."""
        parts = [noise_part(rest, rate) for rest, rate in zip(self.residuals, self.rates)]
        return tuple(
            (faded(noise, rate)[0], share) for (noise, share), rate in zip(parts, self.rates)
        )


def share_frequencies(
    names: Sequence[str],
    sounds: Sequence[ModalSound],
    modes: int | Literal["auto"] | None = None,
) -> Targets:
    """The `modes` modes of greatest energy in all clips, with amplitudes per clip; all if None.

    `auto` takes the partials that are heard, the loudest of each clip, see
    `sound.clips.audibility`; of those closer than `APART` in several clips the louder one stands
    for both. At most `MOST_MODES`, or one for each clip if there are more clips.

    Modes of different clips that sound the same become one, whose frequency and damping are means
    weighted by amplitude. Modes are chosen one by one, each time the strongest of the clip whose
    energy is covered least, or whose loudness is. Shares count, so loud and quiet clips count
    alike.  Raises UserError if fewer modes were extracted from all clips together.
    """
    if modes == "auto":
        sounds = [heard_partials(sound) for sound in sounds]
    owners = np.repeat(np.arange(len(sounds)), [len(sound.frequencies) for sound in sounds])
    frequencies = np.concatenate([sound.frequencies for sound in sounds])
    dampings = np.concatenate([sound.dampings for sound in sounds])
    amplitudes = np.concatenate([sound.amplitudes for sound in sounds])
    if modes == "auto":
        values = [(each.frequencies, each.dampings, each.amplitudes) for each in sounds]
        shares = np.concatenate([loudness_shares(*each) for each in values])
    else:
        shares = np.concatenate([sound.energies / sound.energies.sum() for sound in sounds])

    groups = _groups(frequencies, owners)
    count = int(groups.max()) + 1
    if isinstance(modes, int) and modes > count:
        raise UserError(
            f"{counted(modes, 'mode')} asked for, more than the {count} that were extracted "
            f"from the clips ({', '.join(names)}); ask for fewer"
        )
    table = np.zeros((len(sounds), count))
    covered = table.copy()
    table[owners, groups] = amplitudes
    covered[owners, groups] = shares
    loudness = np.array([np.sqrt(sound.energies.sum()) for sound in sounds])
    weights = amplitudes / loudness[owners]
    weight = np.bincount(groups, weights)
    shared = np.bincount(groups, weights * frequencies) / weight
    if modes == "auto":
        table, covered = _usable(shared, table, covered)
        modes = min(int(covered.any(axis=0).sum()), max(MOST_MODES, len(sounds)))
    chosen = _chosen(covered, count if modes is None else modes)
    chosen = chosen[np.argsort(shared[chosen])]
    return Targets(
        names=tuple(names),
        frequencies=shared[chosen],
        dampings=(np.bincount(groups, weights * dampings) / weight)[chosen],
        amplitudes=table[:, chosen],
        residuals=tuple(sound.residual for sound in sounds),
        rates=tuple(sound.rate for sound in sounds),
        loudness=_loudness(sounds),
    )


def _loudness(sounds: Sequence[ModalSound]) -> ClipLoudness | None:
    """Loudness of the clips that sounds come from; None if one comes from no clip."""
    try:
        rows = [
            (each.evidence["loudness_lufs"], each.evidence["loudness_seconds"]) for each in sounds
        ]
    except KeyError:
        return None
    lufs, seconds = np.array(rows, dtype=float).T
    return ClipLoudness(lufs, seconds)


def without_modes(sound: ModalSound, hertz: Sequence[float]) -> ModalSound:
    """A clip without the modes nearest to some frequencies [Hz], if they sound the same.

    The residual, which contains no modes anyway, stays as it is.  Raises UserError if none is left.

    Examples
    --------
    >>> one = np.ones(3)
    >>> sound = ModalSound(np.array([440.0, 440.5, 990.0]), one, one, one, one, 8000, {})
    >>> without_modes(sound, [440.1, 500.0]).frequencies.tolist()
    [440.5, 990.0]
    """
    kept = np.ones(len(sound.frequencies), dtype=bool)
    for each in hertz:
        nearest = int(np.argmin(np.abs(sound.frequencies - each)))
        if _same(np.array([each, sound.frequencies[nearest]])):
            kept[nearest] = False
    if not kept.any():
        raise UserError(
            "all modes of the clip are left out (without), expected one at least to be kept"
        )
    names = ("frequencies", "dampings", "amplitudes", "phases")
    return replace(sound, **{name: getattr(sound, name)[kept] for name in names})


def _groups(frequencies: Array, owners: NDArray[np.intp]) -> NDArray[np.intp]:
    """Group number (k,) of each mode; modes of one group sound the same, the closest join first.

    A group has at most one mode of each clip.
    """
    groups = np.arange(len(frequencies))
    order = np.argsort(frequencies, kind="stable")
    near = [
        (i, j) for a, i in enumerate(order) for j in order[a + 1 :] if _same(frequencies[[i, j]])
    ]
    for i, j in sorted(near, key=lambda pair: abs(frequencies[pair[0]] - frequencies[pair[1]])):
        members = np.flatnonzero((groups == groups[i]) | (groups == groups[j]))
        apart = len(set(owners[members])) == len(members)
        if groups[i] != groups[j] and apart and _same(frequencies[members]):
            groups[members] = groups[i]
    return np.unique(groups, return_inverse=True)[1]


def _same(frequencies: Array) -> bool:
    low, high = frequencies.min(), frequencies.max()
    return bool(high - low <= max(SAME_HERTZ, SAME_FRACTION * low))


def _usable(frequencies: Array, amplitudes: Array, shares: Array) -> tuple[Array, Array]:
    """Amplitudes (T, k) and shares (T, k) of modes, 0 for modes that a design cannot use.

    The share of a mode close to a stronger one is added to that one's, which takes the greater
    amplitude.
    """
    amplitudes, shares = amplitudes.copy(), shares.copy()
    loudest = amplitudes.max(axis=1, keepdims=True)
    shares[:, ~(amplitudes > HEARD * loudest).any(axis=0)] = 0.0
    kept: list[int] = []
    for mode in np.argsort(-shares.sum(axis=0), kind="stable"):
        near = [k for k in kept if abs(frequencies[mode] / frequencies[k] - 1.0) <= APART]
        if not near:
            kept.append(int(mode))
            continue
        amplitudes[:, near[0]] = np.maximum(amplitudes[:, near[0]], amplitudes[:, mode])
        shares[:, near[0]] += shares[:, mode]
        shares[:, mode] = 0.0
    return amplitudes, shares


def _chosen(shares: Array, modes: int) -> NDArray[np.intp]:
    """Numbers (modes,) of the columns of `shares` (T, k) that cover all rows evenly."""
    left = shares.copy()
    chosen: list[int] = []
    while len(chosen) < modes:
        open_rows = np.flatnonzero(left.any(axis=1))
        covered = shares[open_rows][:, chosen].sum(axis=1)
        least = open_rows[np.argmin(covered)]
        chosen.append(int(np.argmax(left[least])))
        left[:, chosen[-1]] = 0.0
    return np.array(chosen)
