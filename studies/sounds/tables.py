"""Tables of an example's page."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from carillon.fem.model import RIGID_MODES
from sound.design.bark import bark
from sound.design.cents import cents, common_factor
from sound.design.objective import fall
from sound.project.design import Design
from sound.rendering.solid import SoundingSolid
from studies.base.conditions import ONE_COLD_RUN, measured
from studies.base.entry import Row
from studies.sounds import spectral_distance
from studies.sounds.results import SoundResults

Array = NDArray[np.float64]

METHODS = {"hybrid": "Hybrid", "cma": "CMA-ES alone", "bfgs": "L-BFGS alone"}
"""Names of optimisers for people."""
SOLIDS = {
    "before": "Uniform material",
    "coarse": "Design, coarse solid",
    "fine": "Design, fine solid",
}
"""Names of solids whose frequencies are compared with the targets, for people."""

DESIGNED = measured(
    lambda results: {
        f"edit {n}": each.provenance for n, each in enumerate(results.designs.values(), 1)
    },
    ONE_COLD_RUN,
)


def designs(results: SoundResults) -> Iterator[Row]:
    """Cost before and after every edit, and how long it took."""
    for number, part in enumerate(results.example.parts, 1):
        last, evidence = results.history(part)[-1], results.designs[part].evidence
        # Not of the history, which has what the coarse solid foretold.
        before, after = float(evidence["cost_start"]), float(evidence["cost"])
        yield {
            "edit": number,
            "points": ", ".join(results.designs[part].targets.names),
            "cost_before": before,
            "cost": after,
            "fall": fall(before, after),
            "frequency": float(evidence["frequency_cost"]),
            "amplitude": float(evidence["amplitude_cost"]),
            "evaluations": int(last["evaluations"]),
            "seconds": float(last["seconds"]),
            "per_minute": float(60.0 * last["evaluations"] / max(last["seconds"], 1e-9)),
        }


def frequencies(results: SoundResults) -> Iterator[Row]:
    """Target frequencies, and those before and after, mode by mode."""
    targets = results.design.targets
    return _by_mode(
        target=targets.frequencies,
        start=results.start.frequencies,
        start_bark=_bark_difference(results.start.frequencies, targets.frequencies),
        found=results.design.frequencies,
        found_bark=_bark_difference(results.design.frequencies, targets.frequencies),
        damping=targets.dampings,
    )


def truth(results: SoundResults) -> Iterator[Row]:
    """What the fine model with the same material sounds at."""
    targets, design = results.design.targets.frequencies, results.design
    hertz = results.truth.frequencies[RIGID_MODES : RIGID_MODES + len(targets)]
    return _by_mode(
        target=targets,
        found=design.coarse_frequencies,
        truth=hertz,
        error=design.coarse_frequencies / hertz - 1.0,
        bark=_bark_difference(hertz, targets),
    )


def nearness(results: SoundResults) -> Iterator[Row]:
    """How far all frequencies are from their targets, with the factor that is best for them."""
    design, targets = results.design, results.design.targets.frequencies
    solved = results.truth.frequencies[RIGID_MODES : RIGID_MODES + len(targets)]
    states = {
        "before": results.start.frequencies,
        "coarse": design.coarse_frequencies,
        "fine": solved,
    }
    for state, hertz in states.items():
        scaled = common_factor(hertz, targets) * hertz
        apart, steps = cents(scaled, targets), _bark_difference(scaled, targets)
        yield {
            "solid": state,
            "title": SOLIDS[state],
            "rms_cents": _rms(apart),
            "worst_cents": float(np.abs(apart).max()),
            "rms_bark": _rms(steps),
            "worst_bark": float(np.abs(steps).max()),
        }


def distances(results: SoundResults) -> Iterator[Row]:
    """How far modes alone sound from the clip, at every struck point."""
    for name in results.design.targets.names:
        _, rate = results.sound("fine", name)
        target = results.target(name, rate)
        sounds = {state: results.modes_alone(state, name) for state in ("before", "after", "fine")}
        sounds |= {"wanted": target.wanted, "modes": target.modes, "silence": np.zeros(1)}
        apart = {
            state: spectral_distance.log_spectral_distance(sound, target.clip, rate)
            for state, sound in sounds.items()
        }
        yield {"point": name, **apart}


def checks(results: SoundResults) -> Iterator[Row]:
    """What the checks on the fine solid found, one after the other, in the last edit."""
    for number, entry in enumerate(results.design.evidence.get("checks", []), 1):
        yield {"check": number, **entry}


def reach(results: SoundResults) -> list[Row]:
    """Which modes the solid can have, to a hundredth of a cent."""
    return [
        {key: round(value, 2) if key.endswith("_cents") else value for key, value in row.items()}
        for row in results.reached["modes"]
    ]


def amplitudes(results: SoundResults) -> Iterator[Row]:
    """Balance of the modes' amplitudes at every struck point."""
    targets = results.design.targets
    start, after = balance(results.start), balance(results.design)
    target = shares(targets.amplitudes)
    for point, name in enumerate(targets.names):
        for row in _by_mode(target=target[point], start=start[point], found=after[point]):
            yield {"point": name, **row}


def balance(design: Design) -> Array:
    """Amplitudes (T, N) of a design's modes at its struck points, as shares of the loudest."""
    positions = np.array([strike.position for strike in design.strikes])
    inward = np.array([strike.inward for strike in design.strikes])
    return shares(SoundingSolid.of_design(design).amplitudes(positions, inward))


def shares(amplitudes: Array) -> Array:
    """Amplitudes (T, N) over the largest of their row."""
    return np.asarray(amplitudes / amplitudes.max(axis=1, keepdims=True))


REACHED = measured(lambda results: {"all": results.reached["provenance"]}, ONE_COLD_RUN)
COMPARED = measured(lambda results: {"all": results.optimisers["provenance"]}, ONE_COLD_RUN)


def optimisers(results: SoundResults) -> Iterator[Row]:
    """The hybrid optimiser beside its two parts."""
    for row in results.optimisers["rows"]:
        yield {**row, "method": METHODS[row["method"]], "fall": row["fall_percent"] / 100.0}


def evaluation(results: SoundResults) -> list[Row]:
    """How long an evaluation takes."""
    return [results.optimisers["evaluation"]]


def _bark_difference(hertz: Array, target: Array) -> Array:
    """Differences [bark] of frequencies [Hz], without rounding errors."""
    return np.round(bark(hertz) - bark(target), 9) + 0.0


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _by_mode(**columns: Array) -> Iterator[Row]:
    """Rows of columns (N,) with a value a mode."""
    for index, values in enumerate(zip(*columns.values())):
        yield {"mode": index + 1, **dict(zip(columns, map(float, values)))}
