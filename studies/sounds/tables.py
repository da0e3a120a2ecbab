"""Tables of an example's page."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Index
from carillon.fem.model import RIGID_MODES
from sound.design.objective import fall
from sound.design.pitch import bark, cents, common_factor
from sound.levels import decibels, relative_loudness
from sound.project.design import Design
from sound.rendering.solid import SoundingSolid
from sound.synthesis import spectral_distance
from studies.base.conditions import ONE_COLD_RUN, measured
from studies.base.table import Column, Row, hidden, table
from studies.sounds.results import CLIPS, SoundResults

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
REACHED = measured(lambda results: {"all": results.reached["provenance"]}, ONE_COLD_RUN)
COMPARED = measured(lambda results: {"all": results.optimisers["provenance"]}, ONE_COLD_RUN)


@table(
    Column("edit", "Edit", "count"),
    Column("points", "Struck points"),
    Column("cost_before", "Cost before", "score"),
    Column("cost", "after", "score"),
    Column("fall", "Fall", "share"),
    Column("frequency", "E_f after", "score", "bark^2"),
    Column("amplitude", "E_a after", "score"),
    Column("evaluations", "Evaluations", "count"),
    Column("seconds", "Time", "seconds"),
    Column("per_minute", "Evaluations a minute", "count"),
    conditions=DESIGNED,
)
def designs(results: SoundResults) -> Iterator[Row]:
    """Cost of Eq. 4 before and after the search, on the fine solid where it was checked there, and
    what is left of its parts without their weights: E_f of the frequencies [bark²] (Eq. 1) and E_a
    of the amplitudes (Eq. 2). Every edit goes on from the material of the one before."""
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


@table(
    Column("mode", "Mode", "count"),
    Column("target", "Target [Hz]", "hertz"),
    Column("start", "Before [Hz]", "hertz"),
    Column("start_bark", "difference [bark]", "fraction", "bark"),
    Column("found", "After [Hz]", "hertz"),
    Column("found_bark", "difference [bark]", "fraction", "bark"),
    Column("damping", "Damping [1/s]", "fraction", "1/s"),
)
def frequencies(results: SoundResults) -> Iterator[Row]:
    """Frequencies of the elastic modes, on the fine solid where the search was checked there, but
    for modes between partials that stay silent. A factor common to all moduli brings them nearest
    to the targets, by least squares of cents. Differences are in bark, critical bands of
    hearing."""
    targets = results.design.targets
    return _by_mode(
        targets.sounding,
        target=targets.frequencies,
        start=results.start.frequencies,
        start_bark=_bark_difference(results.start.frequencies, targets.frequencies),
        found=results.design.frequencies,
        found_bark=_bark_difference(results.design.frequencies, targets.frequencies),
        damping=targets.dampings,
    )


@table(
    Column("mode", "Mode", "count"),
    Column("target", "Target [Hz]", "hertz"),
    Column("found", "Coarse model [Hz]", "hertz"),
    Column("truth", "Fine model [Hz]", "hertz"),
    Column("error", "Coarse from fine", "percent"),
    Column("bark", "Fine from target [bark]", "fraction", "bark"),
)
def truth(results: SoundResults) -> Iterator[Row]:
    """The same material on all {truth.mesh.n_cells:count} voxels, solved by SLEPc: what the coarse
    model of {design.model.mesh.n_cells:count} cells, on which the material was sought, errs by, and
    how far the fine model is from the targets."""
    targets, design = results.design.targets.frequencies, results.design
    hertz = results.truth.frequencies[RIGID_MODES : RIGID_MODES + len(targets)]
    return _by_mode(
        design.targets.sounding,
        target=targets,
        found=design.coarse_frequencies,
        truth=hertz,
        error=design.coarse_frequencies / hertz - 1.0,
        bark=_bark_difference(hertz, targets),
    )


@table(
    hidden("solid", "Solid"),
    Column("title", "Solid"),
    Column("rms_cents", "Rms [cents]", "fraction", "cents"),
    Column("worst_cents", "Largest [cents]", "fraction", "cents"),
    Column("rms_bark", "Rms [bark]", "fraction", "bark"),
    Column("worst_bark", "Largest [bark]", "fraction", "bark"),
)
def nearness(results: SoundResults) -> Iterator[Row]:
    """How far the frequencies of all partials are from their targets: each solid with the factor of
    its moduli that is best for it, by least squares of cents."""
    design, which = results.design, results.design.targets.sounding
    targets = design.targets.frequencies[which]
    solved = results.truth.frequencies[RIGID_MODES:]
    states = {
        "before": results.start.frequencies,
        "coarse": design.coarse_frequencies,
        "fine": solved,
    }
    for state, of_all in states.items():
        hertz = of_all[which]
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


@table(
    Column("point", "Struck point"),
    Column("silence", "Silence [dB]", "fraction", "dB"),
    Column("before", "Before [dB]", "fraction", "dB"),
    Column("after", "After [dB]", "fraction", "dB"),
    Column("fine", "After, fine model [dB]", "fraction", "dB"),
    Column("wanted", "Modes designed [dB]", "fraction", "dB"),
    Column("modes", "All modes of the clip [dB]", "fraction", "dB"),
    floor=abs(spectral_distance.FLOOR_DECIBELS),
)
def distances(results: SoundResults) -> Iterator[Row]:
    """How far modes alone sound from the clip, from where its modes ring freely on: rms difference
    of the levels in third-octave bands from 100 Hz to 16 kHz, in windows of 23 ms, down to
    {floor:count} dB below the loudest. Modes designed are those of the clip that were asked for, as
    a perfect material sounds; all modes of the clip are what the extraction knows of it; silence is
    at the floor."""
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


@table(
    Column("point", "Struck point"),
    Column("clip", "Clip [LUFS]", "fraction", "LUFS"),
    Column("before", "Before [LU]", "fraction", "LU"),
    Column("after", "After [LU]", "fraction", "LU"),
    Column("fine", "After, fine model [LU]", "fraction", "LU"),
    Column("peak", "Peak after [dBFS]", "fraction", "dBFS"),
)
def loudness(results: SoundResults) -> Iterator[Row]:
    """Integrated loudness of the clips (ITU-R BS.1770), and how much louder a strike of 1 N s is,
    over the length that both have in common, as it is written."""
    for name in results.design.targets.names:
        clip, own = results.sound(CLIPS, name)
        row: dict[str, float] = {}
        for state in ("before", "after", "fine"):
            sound, rate = results.sound(state, name)
            seconds = min(len(clip) / own, len(sound) / rate)
            ours, theirs = (
                relative_loudness(samples[: round(seconds * hertz)], hertz)
                for samples, hertz in ((sound, rate), (clip, own))
            )
            row[state] = ours - theirs
        peak = decibels(float(np.abs(results.sound("after", name)[0]).max()))
        yield {"point": name, "clip": relative_loudness(clip, own), "peak": peak, **row}


@table(
    Column("check", "Check", "count"),
    Column("seconds", "After", "seconds"),
    Column("evaluations", "Evaluations", "count"),
    Column("coarse_rms_cents", "Coarse, rms [cents]", "fraction", "cents"),
    Column("fine_rms_cents", "Fine, rms [cents]", "fraction", "cents"),
    Column("foretold_rms_cents", "Foretold [cents]", "fraction", "cents"),
    Column("cost", "Cost", "score"),
    conditions=DESIGNED,
)
def checks(results: SoundResults) -> Iterator[Row]:
    """Checks of the search on the fine solid: how far frequencies are from their targets on the
    coarse solid and on the fine one, how far the fine ones are from what the search foretold, each
    with the factor of the moduli that is best for it, and the cost on the fine solid."""
    for number, entry in enumerate(results.design.evidence.get("checks", []), 1):
        yield {"check": number, **entry}


@table(
    Column("mode", "Mode", "count"),
    Column("target_hz", "Target [Hz]", "hertz"),
    Column("cents", "Design [cents]", "fraction", "cents"),
    Column("alone_cents", "By itself [cents]", "fraction", "cents"),
    Column("beside_cents", "With neighbours [cents]", "fraction", "cents"),
    Column("verdict", "Can be had"),
    conditions=REACHED,
)
def reach(results: SoundResults) -> list[Row]:
    """Which modes the fine solid can have, each relative to the first one: how far above its target
    the design has it; the least distance of any material that was looked at, none where materials
    on both sides of the target say that one between them has it; the same of it and its two
    neighbours, the largest of the three. The first {reached[together]} modes were had together,
    amplitudes aside. A mode is had within {reached[had_cents]:count} cents. That descents did not
    find a material is no proof that there is none."""
    return [
        {key: round(value, 2) if key.endswith("_cents") else value for key, value in row.items()}
        for row in results.reached["modes"]
    ]


@table(
    Column("point", "Struck point"),
    Column("mode", "Mode", "count"),
    Column("target", "Target", "score"),
    Column("start", "Before", "score"),
    Column("found", "After", "score"),
    keys="point mode",
)
def amplitudes(results: SoundResults) -> Iterator[Row]:
    """Amplitudes of the modes after a strike along the inward normal, as shares of the loudest
    mode's at the same point."""
    targets = results.design.targets
    start, after = balance(results.start), balance(results.design)
    target = shares(targets.amplitudes)
    for point, name in enumerate(targets.names):
        columns = {"target": target[point], "start": start[point], "found": after[point]}
        for row in _by_mode(np.arange(target.shape[1]), **columns):
            yield {"point": name, **row}


def balance(design: Design) -> Array:
    """Amplitudes (T, N) of a design's modes at its struck points, as shares of the loudest."""
    positions = np.array([strike.position for strike in design.strikes])
    inward = np.array([strike.inward for strike in design.strikes])
    return shares(SoundingSolid.of_design(design).amplitudes(positions, inward))


def shares(amplitudes: Array) -> Array:
    """Amplitudes (T, N) over the largest of their row."""
    return np.asarray(amplitudes / amplitudes.max(axis=1, keepdims=True))


@table(
    Column("method", "Optimiser"),
    Column("cost_start", "Cost before", "score"),
    Column("cost_end", "after", "score"),
    Column("fall", "Fall", "share"),
    Column("seconds_to_90_percent", "90 % after", "seconds"),
    Column("evaluations", "Evaluations", "count"),
    Column("evaluations_per_minute", "a minute", "count"),
    Column("seconds", "Time", "seconds"),
    conditions=COMPARED,
)
def optimisers(results: SoundResults) -> Iterator[Row]:
    """The hybrid optimiser beside its two parts alone, each from the uniform material and for the
    same processor time. 90 %: the time in which the cost fell by as much."""
    for row in results.optimisers["rows"]:
        yield {**row, "method": METHODS[row["method"]], "fall": row["fall_percent"] / 100.0}


@table(
    Column("n_dofs", "Unknowns", "count"),
    Column("modes", "Modes", "count"),
    Column("coordinates", "Coordinates", "count"),
    Column("cold_seconds", "Cold", "seconds"),
    Column("warm_seconds", "Warm", "seconds"),
    Column("gradient_seconds", "with derivatives", "seconds"),
    Column("analysis_seconds", "Analysis", "seconds"),
    conditions=COMPARED,
)
def evaluation(results: SoundResults) -> list[Row]:
    """Processor time of one evaluation on one thread, median: cold from nothing, warm from the
    modes of a material nearby, and warm with the derivatives of all frequencies and amplitudes. Of
    the warm one, the modal analysis takes the last column."""
    return [results.optimisers["evaluation"]]


def _bark_difference(hertz: Array, target: Array) -> Array:
    """Differences [bark] of frequencies [Hz], without rounding errors."""
    return np.round(bark(hertz) - bark(target), 9) + 0.0


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _by_mode(which: Index, **columns: Array) -> Iterator[Row]:
    for index in which:
        yield {"mode": int(index) + 1, **{key: float(columns[key][index]) for key in columns}}
