"""What stands most between a design and its clips, and what may help."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array
from carillon.command_line.counts import counted
from sound.clips.extraction import ModalSound
from sound.design.search import BUDGET, INTERRUPT
from sound.project.design import Design
from sound.rendering.better_point import better_point
from sound.rendering.likeness import LIKE_CENTS, LIKE_RATIO, Likeness, furthest_decay
from sound.rendering.listening import Listening
from sound.rendering.solid import SoundingSolid

LOUD_DECIBELS, MOST_DECIBELS = 12.0, 60.0
"""Error of a partial's level [dB] that is told, and level below the loudest that counts as none."""
GAIN = 0.05
"""Share of the cost that the last part of a search takes off if it gets on."""
FEW_CHECKS = 3
"""Least number of checks on the fine solid by which a search tells whether its cost still falls."""
FEW_EVALUATIONS, TIMES = 16, 5
"""Least number of evaluations by which a search without checks tells it, and number of times at
which its cost is looked at: the last two are the last half of the search."""
FAR_CENTS = 50.0
"""Distance of a partial [cents] that is told."""
MOSTLY = 0.5
"""Share of a clip's energy in what is no mode, beyond which this is told first."""
MUCH = 0.2
"""Share of the loudness in partials without a mode, beyond which this is told first."""
CLIPS_DAMPINGS = "take the dampings of the clips (damping: {source: clips})"
ANOTHER_SOLID = "take another solid"
OTHER_MATERIALS = (
    "name other materials below build, let its cubes be smaller, or its size be free (size: free)"
)


@dataclass(frozen=True)
class Judged:
    """A design beside its clips: its solid, what is heard of it, distances of its partials (p,)
    [cents], and its likeness to each clip."""

    design: Design
    clips: Sequence[ModalSound]
    solid: SoundingSolid
    listening: Listening
    cents: Array
    likeness: Sequence[Likeness]

    @property
    def has_own_dampings(self) -> bool:
        """Whether the dampings that sound are those of the material, not of the clips."""
        source: str = self.design.settings.get("damping", {}).get("source", "clips")
        return source == "material"


def reason_of(judged: Judged) -> tuple[str, str]:
    """What stands most between a design and its clips, and one suggestion."""
    for find in (_of_clip, _much_left_out, _far, _off, _damped, _level, _decay, _left_out):
        found = find(judged)
        if found is not None:
            return found
    worst = max(judged.likeness, key=lambda each: each.distance_db)
    return "the balance of its partials is another one", _elsewhere(judged, worst)


def rings(likeness: Sequence[Likeness]) -> str:
    """How much longer or shorter a design rings than its clips; empty if it does not."""
    worst = furthest_decay(likeness)
    if worst.times <= LIKE_RATIO:
        return ""
    side = "longer" if worst.decay_ratio > 1.0 else "shorter"
    return f"it rings {worst.times:.1f} times {side} than the clip"


def foreign_share(clips: Sequence[ModalSound]) -> float:
    """Greatest share of a clip's energy in what is no mode: noise, and tones that do not fade
    evenly."""
    return max(_foreign(clip) for clip in clips)


def _foreign(clip: ModalSound) -> float:
    whole = clip.modal_part() + clip.residual
    return float(clip.residual @ clip.residual) / max(float(whole @ whole), 1e-300)


def _of_clip(judged: Judged) -> tuple[str, str] | None:
    share = foreign_share(judged.clips)
    if share <= MOSTLY:
        return None
    return (
        f"{min(share, 1.0):.0%} of the clip's energy is noise, or tones that do not fade evenly, "
        "which no material has",
        "take a clip of one strike that rings",
    )


def _much_left_out(judged: Judged) -> tuple[str, str] | None:
    """Partials without a mode that are louder than all that are far off."""
    targets = judged.design.targets
    far = targets.shares[targets.sounding][np.abs(judged.cents) > FAR_CENTS].sum()
    return _left_out(judged) if targets.left_out_share > max(far, MUCH) else None


def _left_out(judged: Judged) -> tuple[str, str] | None:
    missing = judged.design.targets.left_out
    if missing is None or not len(missing):
        return None
    hertz = ", ".join(f"{each:.0f}" for each in missing)
    return (
        f"no mode of the solid can have the clip's partials at {hertz} Hz",
        "take a solid with more modes below them: a longer or a thinner one",
    )


def _far(judged: Judged) -> tuple[str, str] | None:
    off, targets = judged.cents, judged.design.targets
    which, far = targets.sounding, np.abs(off) > FAR_CENTS
    if not far.any():
        return None
    worst = int(np.argmax(np.where(far, targets.shares[which], -1.0)))
    # Two modes of one frequency may have one partial.
    hertz = targets.frequencies[which]
    wrong, partials = np.unique(hertz[far]), len(np.unique(hertz))
    side = "high" if off[worst] > 0.0 else "low"
    are = "is" if len(wrong) == 1 else "are"
    return (
        f"{len(wrong)} of {counted(partials, 'partial')} {are} more than {FAR_CENTS:.0f} cents "
        f"off, that at {hertz[worst]:.0f} Hz {abs(off[worst]):.0f} cents too {side}",
        _search_on(judged.design) or _without(wrong, partials),
    )


def _off(judged: Judged) -> tuple[str, str] | None:
    median = float(np.median(np.abs(judged.cents)))
    if median <= LIKE_CENTS:
        return None
    return (
        f"half of its partials are more than {median:.0f} cents off",
        _search_on(judged.design) or ANOTHER_SOLID,
    )


def _search_on(design: Design) -> str:
    """Advice to search on, where a search ended before it had found what it can."""
    if design.evidence.get("build"):
        return OTHER_MATERIALS
    if design.evidence.get("ended_by") not in (BUDGET, INTERRUPT):
        return ""
    checks = [each["cost"] for each in design.evidence.get("checks", [])]
    costs = np.minimum.accumulate(checks or _own_costs(design))
    if len(costs) < FEW_CHECKS:
        return "search on, it had little time"
    falls = costs[-1] < (1.0 - GAIN) * costs[-FEW_CHECKS]
    return "search on, the cost still falls" if falls else ""


def _own_costs(design: Design) -> list[float]:
    """Costs at some times of the last search, evenly over its evaluations: those of a search
    without checks.

    Former ones may have had other targets.
    """
    made, costs = design.history["evaluations"], design.history["cost"]
    own = int(design.evidence["evaluations"])
    if own < FEW_EVALUATIONS:
        return []
    at = np.linspace(made[-1] - own + 1, made[-1], TIMES)
    return [float(costs[row]) for row in np.minimum(np.searchsorted(made, at), len(made) - 1)]


def _without(hertz: Array, partials: int) -> str:
    if len(hertz) > 0.5 * partials:
        return ANOTHER_SOLID
    listed = ", ".join(f"{each:.0f}" for each in hertz)
    return f"leave these out (without: [{listed}]), or {ANOTHER_SOLID}"


def _damped(judged: Judged) -> tuple[str, str] | None:
    """Modes that the material damps otherwise than the clips."""
    targets, solid = judged.design.targets, judged.solid
    if not judged.has_own_dampings:
        return None
    ratios = np.maximum(solid.dampings, 1e-9) / targets.dampings
    far = np.flatnonzero(np.maximum(ratios, 1.0 / ratios) > LIKE_RATIO)
    if not len(far):
        return None
    worst = far[np.argmax(np.abs(np.log(ratios[far])))]
    times = max(ratios[worst], 1.0 / ratios[worst])
    side = "slower" if ratios[worst] < 1.0 else "faster"
    return (
        f"the material damps {len(far)} of {counted(len(ratios), 'mode')} otherwise than the "
        f"clips, that at {solid.frequencies[worst]:.0f} Hz {times:.1f} times {side}",
        CLIPS_DAMPINGS,
    )


def _level(judged: Judged) -> tuple[str, str] | None:
    """The mode whose share of the energy is furthest from the clip's where a target is struck."""
    strikes, targets = judged.design.strikes, judged.design.targets
    positions = np.array([strike.position for strike in strikes])
    inward = np.array([strike.inward for strike in strikes])
    which = targets.sounding
    own = _energy_shares(judged.solid.amplitudes(positions, inward)[:, which])
    aims = _energy_shares(targets.amplitudes[:, which])
    point, partial = divmod(int(np.argmax(np.abs(own - aims))), len(which))
    least = 10.0 ** (-MOST_DECIBELS / 10.0)
    ratio = max(own[point, partial], least) / max(aims[point, partial], least)
    wrong = 10.0 * np.log10(ratio)
    if abs(wrong) <= LOUD_DECIBELS:
        return None
    return (
        f"the mode at {judged.solid.frequencies[which[partial]]:.0f} Hz is {abs(wrong):.0f} dB too "
        f"{'loud' if wrong > 0.0 else 'faint'} where {strikes[point].name} is struck",
        _elsewhere(judged, judged.likeness[point]),
    )


def _energy_shares(amplitudes: Array) -> Array:
    squares = amplitudes**2
    return np.asarray(squares / np.maximum(squares.sum(axis=1, keepdims=True), 1e-300))


def _decay(judged: Judged) -> tuple[str, str] | None:
    told = rings(judged.likeness)
    if not told:
        return None
    if judged.has_own_dampings:
        return told, CLIPS_DAMPINGS
    # Each partial dies away as the clip's: another balance of them makes the difference.
    return told, _elsewhere(judged, furthest_decay(judged.likeness))


def _elsewhere(judged: Judged, now: Likeness) -> str:
    """Advice to strike another point, if one is better."""
    design = judged.design
    target = [strike.name for strike in design.strikes].index(now.target)
    clip = judged.clips[target]
    whole = clip.modal_part() + clip.residual
    found = better_point(design, judged.solid, judged.listening, target, whole, clip.rate, now)
    if found is None:
        return f"no other point of this design comes nearer: {ANOTHER_SOLID}"
    unit = design.settings.get("unit", 1.0)
    at = ", ".join(f"{each:.4g}" for each in found[0] / unit)
    there = found[1]
    return (
        f"name [{at}] as the point of {now.target} and search again: even this material, struck "
        f"there and made as loud, is {there.distance_db:.1f} dB from the clip (now "
        f"{now.distance_db:.1f}) and rings {there.decay_ratio:.1f} times as long (now "
        f"{now.decay_ratio:.1f})"
    )
