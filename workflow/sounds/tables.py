"""Tables of an example's page."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.fem.model import RIGID_MODES
from sound.design.bark import bark
from sound.project.design_file import Design
from sound.rendering.solid import SoundingSolid
from workflow.report.conditions import ONE_COLD_RUN, Conditions, conditions
from workflow.report.evidence_tables import provenance_table
from workflow.report.table import Column, Table
from workflow.sounds.examples import DESIGN, START, TRUTH
from workflow.sounds.results import Found

Array = NDArray[np.float64]
Row = dict[str, Any]


def build(found: Found) -> dict[str, Table]:
    """All tables by name, as far as there is something to tell."""
    made = [designs(found), frequencies(found), truth(found), amplitudes(found)]
    if found.optimisers:
        made += [optimisers(found), evaluation(found)]
    return {table.name: table for table in [*made, provenance(found)]}


def designs(found: Found) -> Table:
    """Cost before and after every edit, and how long it took."""
    return Table(
        "designs",
        "Cost of Eq. 4 before and after the search, and its parts without their weights: E_f of "
        "the frequencies [bark²] (Eq. 1) and E_a of the amplitudes (Eq. 2). Every edit goes on "
        "from the material of the one before.",
        [
            Column("edit", "Edit", "count"),
            Column("points", "Struck points"),
            Column("cost_before", "Cost before", "score"),
            Column("cost", "after", "score"),
            Column("fall", "Fall", "share"),
            Column("frequency_before", "E_f before", "score", "bark^2"),
            Column("frequency", "after", "score", "bark^2"),
            Column("amplitude_before", "E_a before", "score"),
            Column("amplitude", "after", "score"),
            Column("evaluations", "Evaluations", "count"),
            Column("seconds", "Time", "seconds", "s"),
            Column("per_minute", "Evaluations a minute", "count"),
        ],
        [_design_row(found, part) for part in found.example.parts],
        conditions=conditions(
            {f"edit {n}": each.provenance for n, each in enumerate(found.designs.values(), 1)},
            found.config,
            ONE_COLD_RUN,
        ),
    )


def _design_row(found: Found, part: str) -> Row:
    rows = found.history(part)
    first, last = rows[0], rows[-1]
    return {
        "edit": found.example.edit_of(part),
        "points": ", ".join(found.designs[part].targets.names),
        "cost_before": float(first["cost"]),
        "cost": float(last["cost"]),
        "fall": float(1.0 - last["cost"] / first["cost"]),
        "frequency_before": float(first["frequency_cost"]),
        "frequency": float(last["frequency_cost"]),
        "amplitude_before": float(first["amplitude_cost"]),
        "amplitude": float(last["amplitude_cost"]),
        "evaluations": int(last["evaluations"]),
        "seconds": float(last["seconds"]),
        "per_minute": float(60.0 * last["evaluations"] / max(last["seconds"], 1e-9)),
    }


def frequencies(found: Found) -> Table:
    """Frequencies wanted, before and after, mode by mode."""
    return Table(
        "frequencies",
        "Frequencies of the elastic modes. The first sounds at its target by the choice of a "
        "factor common to all moduli. Differences are in bark, critical bands of hearing.",
        [
            Column("mode", "Mode", "count"),
            Column("target", "Target [Hz]", "hertz", "Hz"),
            Column("start", "Before [Hz]", "hertz", "Hz"),
            Column("start_bark", "difference [bark]", "fraction", "bark"),
            Column("found", "After [Hz]", "hertz", "Hz"),
            Column("found_bark", "difference [bark]", "fraction", "bark"),
            Column("damping", "Damping [1/s]", "fraction", "1/s"),
        ],
        list(_frequency_rows(found)),
    )


def _frequency_rows(found: Found) -> Iterator[Row]:
    targets = found.design.targets
    columns = {
        "target": targets.frequencies,
        "start": found.start.frequencies,
        "start_bark": _bark_difference(found.start.frequencies, targets.frequencies),
        "found": found.design.frequencies,
        "found_bark": _bark_difference(found.design.frequencies, targets.frequencies),
        "damping": targets.dampings,
    }
    for index in range(len(targets.frequencies)):
        yield {"mode": index + 1, **_at(columns, index)}


def truth(found: Found) -> Table:
    """What the fine model with the same material sounds at."""
    targets, design = found.design.targets, found.design
    hertz = found.truth.frequencies[RIGID_MODES : RIGID_MODES + len(targets.frequencies)]
    columns = {
        "target": targets.frequencies,
        "found": design.frequencies,
        "truth": hertz,
        "error": design.frequencies / hertz - 1.0,
        "bark": _bark_difference(hertz, targets.frequencies),
    }
    return Table(
        "truth",
        f"The same material on all {found.truth.mesh.n_cells:,} voxels, solved by SLEPc: what the "
        f"coarse model of {design.model.mesh.n_cells:,} cells, on which the material was sought, "
        "errs by, and how far the fine model is from the targets.",
        [
            Column("mode", "Mode", "count"),
            Column("target", "Target [Hz]", "hertz", "Hz"),
            Column("found", "Coarse model [Hz]", "hertz", "Hz"),
            Column("truth", "Fine model [Hz]", "hertz", "Hz"),
            Column("error", "Coarse from fine", "percent"),
            Column("bark", "Fine from target [bark]", "fraction", "bark"),
        ],
        [{"mode": index + 1, **_at(columns, index)} for index in range(len(hertz))],
    )


def amplitudes(found: Found) -> Table:
    """Balance of the modes' amplitudes at every struck point."""
    return Table(
        "amplitudes",
        "Amplitudes of the modes after a strike along the inward normal, as shares of the loudest "
        "mode's at the same point.",
        [
            Column("point", "Struck point"),
            Column("mode", "Mode", "count"),
            Column("target", "Target", "score"),
            Column("start", "Before", "score"),
            Column("found", "After", "score"),
        ],
        list(_amplitude_rows(found)),
        ["point", "mode"],
    )


def _amplitude_rows(found: Found) -> Iterator[Row]:
    names = found.design.targets.names
    start, after = balance(found.start), balance(found.design)
    wanted = shares(found.design.targets.amplitudes)
    for point, name in enumerate(names):
        columns = {"target": wanted[point], "start": start[point], "found": after[point]}
        for index in range(wanted.shape[1]):
            yield {"point": name, "mode": index + 1, **_at(columns, index)}


def balance(design: Design) -> Array:
    """Amplitudes (T, N) of a design's modes at its struck points, as shares of the loudest."""
    positions = np.array([strike.position for strike in design.strikes])
    inward = np.array([strike.inward for strike in design.strikes])
    return shares(SoundingSolid.of_design(design).amplitudes(positions, inward))


def shares(amplitudes: Array) -> Array:
    """Amplitudes (T, N) over the largest of their row."""
    return np.asarray(amplitudes / amplitudes.max(axis=1, keepdims=True))


def optimisers(found: Found) -> Table:
    """The hybrid optimiser beside its two parts."""
    return Table(
        "optimisers",
        "The hybrid optimiser beside its two parts alone, each from the uniform material and for "
        "the same wall time. 90 %: the time in which the cost fell by as much.",
        [
            Column("method", "Optimiser"),
            Column("cost_start", "Cost before", "score"),
            Column("cost_end", "after", "score"),
            Column("fall", "Fall", "share"),
            Column("seconds_to_90_percent", "90 % after", "seconds", "s"),
            Column("evaluations", "Evaluations", "count"),
            Column("evaluations_per_minute", "a minute", "count"),
            Column("seconds", "Time", "seconds", "s"),
        ],
        [_optimiser_row(row) for row in _compared(found)["rows"]],
        conditions=_compared_conditions(found),
    )


def _optimiser_row(row: Row) -> Row:
    told = {key: value for key, value in row.items() if key != "curve"}
    return {**told, "method": METHODS[row["method"]], "fall": row["fall_percent"] / 100.0}


def evaluation(found: Found) -> Table:
    """How long an evaluation takes."""
    return Table(
        "evaluation",
        "Wall time of one evaluation on one thread, median: cold from nothing, warm from the modes "
        "of a material nearby, and warm with the derivatives of all frequencies and amplitudes. "
        "Of the warm one, the modal analysis takes the last column.",
        [
            Column("n_dofs", "Unknowns", "count"),
            Column("modes", "Modes", "count"),
            Column("coordinates", "Coordinates", "count"),
            Column("cold_seconds", "Cold", "seconds", "s"),
            Column("warm_seconds", "Warm", "seconds", "s"),
            Column("gradient_seconds", "with derivatives", "seconds", "s"),
            Column("analysis_seconds", "Analysis", "seconds", "s"),
        ],
        [_compared(found)["evaluation"]],
        conditions=_compared_conditions(found),
    )


def _compared(found: Found) -> dict[str, Any]:
    assert found.optimisers is not None
    return found.optimisers


def _compared_conditions(found: Found) -> Conditions | None:
    origin = _compared(found).get("provenance")
    return conditions({"all": origin}, found.config, ONE_COLD_RUN) if origin else None


METHODS = {"hybrid": "Hybrid", "cma": "CMA-ES alone", "bfgs": "L-BFGS alone"}
"""Names of optimisers for people."""


def provenance(found: Found) -> Table:
    """Command, code and machine behind every file that the page draws on."""
    origins = {f"{part}/{DESIGN}": each.provenance for part, each in found.designs.items()}
    origins[f"{found.example.name}/{START}"] = found.start.provenance
    origins[f"{found.example.name}/{TRUTH}"] = found.truth.provenance
    if found.optimisers:
        name = f"{found.example.name}/optimisers.json"
        origins[name] = found.optimisers.get("provenance", {})
    return provenance_table(origins)


def _bark_difference(found: Array, wanted: Array) -> Array:
    """Differences [bark] of frequencies [Hz], without rounding errors."""
    return np.round(bark(found) - bark(wanted), 9) + 0.0


def _at(columns: dict[str, Array], index: int) -> Row:
    return {key: float(values[index]) for key, values in columns.items()}
