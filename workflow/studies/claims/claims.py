"""What is measured of each claim, and whether it agrees: a function a claim."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from workflow.studies.base.numbers import show
from workflow.studies.base.table import Table
from workflow.studies.claims.results import MEASURED, Claims
from workflow.studies.report.blocks_tables import LOWER_BOUND
from workflow.studies.report.convergence_tables import (
    ACCELERATIONS,
    PAPER,
    RANDOM,
    SYNTHESIS,
    start_label,
)
from workflow.variants import VARIANTS

REPRODUCED, LESS, IN_PART, NOT = "reproduced", "less is needed", "in part", "not reproduced"
UNMEASURED = "not measured"
"""Verdicts."""
SAME_SHAPE, ROUGH_SHAPE = 0.999, 0.9
"""Likeness of a mode that is the truth's, and that has its rough motion."""
THREE_ORDERS, TWO_ORDERS = 1e3, 1e2
SIMILAR = 0.1
"""Errors, relative ones too, below which two blocks, costs or motions count as alike."""
DAY = 86400.0
ROWS_OF_A_FIT = 8
"""A fit is seen from the eight corners of its block."""
STILL = 1.0
"""Relative difference of a motion from the true one that no motion at all would have."""
INTERACTIVE = 3.0
"""Seconds of a solve that the paper finds interactive."""
EXACT = "HCMS + EC"
"""The corrected method on the fine mesh, in tables of the validation."""


@dataclass(frozen=True)
class Finding:
    """What was measured of a claim.

    Attributes
    ----------
    verdict
        Whether it agrees.
    text
        The figures, in words.
    files
        Tables that they are from.
    """

    verdict: str
    text: str
    files: tuple[str, ...] = ()


def shapes(claims: Claims) -> Finding:
    """Fig. 8: the first elastic mode."""
    tables = claims.of_model("shapes")
    by_method = {
        method: [
            row["likeness"]
            for table in tables.values()
            for row in table.rows
            if row["method"] == method
        ]
        for method in (VARIANTS["hcms"].label, EXACT)
    }
    rough, corrected = (min(values) for values in by_method.values())
    if corrected < SAME_SHAPE:
        verdict = NOT
    else:
        verdict = REPRODUCED if rough > ROUGH_SHAPE else IN_PART
    text = (
        f"Least likeness of mode 7 over {len(tables)} solids: {show(rough, 'fraction')} by HCMS, "
        f"{show(corrected, 'fraction')} after error correction."
    )
    return Finding(verdict, text, files(claims, "-shapes.json"))


def blocks(claims: Claims) -> Finding:
    """Fig. 9, top: errors on single blocks."""
    rows = by_method(claims.of_run("blocks"))
    average, least = rows["average"]["kind0_nodal"], rows[LOWER_BOUND]["kind0_nodal"]
    forests, database = forests_row(rows)["kind0_nodal"], database_row(rows)["kind0_nodal"]
    text = (
        f"Averaging {show(average, 'fraction')}, forests {show(forests, 'fraction')}, database "
        f"{show(database, 'fraction')}; the least of any element of eight moduli is "
        f"{show(least, 'fraction')}, {show(average / least, 'times')} less than averaging."
    )
    claimed = (
        claims.paper["blocks"]["average"]["error"] / claims.paper["blocks"]["forests"]["error"]
    )
    verdict = REPRODUCED if average / forests >= (1.0 - SIMILAR) * claimed else NOT
    return Finding(verdict, text, ("tables/blocks.json",))


def scaling(claims: Claims) -> Finding:
    """Fig. 9, bottom: errors on blocks beyond the range trained on."""
    row = forests_row(by_method(claims.of_run("blocks")))
    within, beyond = row["kind0_nodal"], row["kind1_nodal"]
    verdict = REPRODUCED if beyond <= (1.0 + SIMILAR) * within else NOT
    told = [show(value, "fraction") for value in (within, beyond)]
    text = f"{told[0]} on 0 to 10 GPa, {told[1]} on 100 to 10,000 GPa."
    return Finding(verdict, text, ("tables/blocks.json",))


def evaluation(claims: Claims) -> Finding:
    """Fig. 9: the cost of a block."""
    rows = by_method(claims.of_run("blocks"))
    forests, database = forests_row(rows), database_row(rows)
    ours, others = forests["seconds_per_block"], database["seconds_per_block"]
    claimed = claims.paper["blocks"]["forests"]["seconds"]
    if ours > claimed:
        verdict = NOT
    else:
        verdict = REPRODUCED if ours < others else IN_PART
    text = (
        f"{show(ours, 'seconds')} by the forests, {show(others, 'seconds')} by a database of "
        f"{show(database['storage_bytes'], 'bytes')}."
    )
    return Finding(verdict, text, ("tables/blocks.json",))


def storage(claims: Claims) -> Finding:
    """Fig. 9: the size of the forests."""
    row = forests_row(by_method(claims.of_run("blocks")))
    kept = claims.forests_bytes
    package = f"; those that come with Carillon {show(kept, 'bytes')}" if kept else ""
    text = f"{show(row['storage_bytes'], 'bytes')} for the forests of this run{package}."
    claimed = 1e6 * claims.paper["blocks"]["forests"]["megabytes"]
    verdict = LESS if max(row["storage_bytes"], kept or 0) <= claimed else NOT
    return Finding(verdict, text, ("tables/blocks.json",))


def training(claims: Claims) -> Finding:
    """Section 8.1: the time of the training."""
    rows = claims.of_run("blocks").rows
    row = forests_row(by_method(claims.of_run("blocks")))
    quantities = {each["key"]: each["value"] for each in claims.of_run("training").rows}
    seconds = row.get("training_seconds")
    if seconds is None or "fits" not in quantities:
        return Finding(
            UNMEASURED, "This run took forests that were there.", ("tables/training.json",)
        )
    fit = next(each for each in rows if is_fit_of(each, row))
    errors = row["kind0_nodal"], fit["kind0_nodal"]
    text = (
        f"{show(seconds, 'seconds')} for trees and leaves from "
        f"{show(ROWS_OF_A_FIT * quantities['fits'], 'count')} rows; on blocks these forests err by "
        f"{show(errors[0], 'fraction')}, the fits that they learned from by "
        f"{show(errors[1], 'fraction')}."
    )
    days = sum(claims.paper["training"][key] for key in ("structure_days", "leaves_days"))
    learned = errors[0] <= (1.0 + SIMILAR) * errors[1]
    verdict = LESS if learned and seconds < DAY * days else NOT
    return Finding(verdict, text, ("tables/blocks.json", "tables/training.json"))


def convergence(claims: Claims) -> Finding:
    """Fig. 10: corrections from HCMS and from random vectors."""
    table = claims.in_full("convergence") or claims.of_run("convergence")
    if not table.rows:
        return Finding(UNMEASURED, "No convergence was followed in this run.")
    told, agree = [], []
    for model in dict.fromkeys(row["model"] for row in table.rows):
        rows = [
            row
            for row in table.rows
            if row["model"] == model and row["acceleration"] == ACCELERATIONS[PAPER]
        ]
        last = max(row["corrections"] for row in rows)
        worst = {
            start: next(
                row["max"]
                for row in rows
                if row["start"] == start_label(start) and row["corrections"] == last
            )
            for start in (SYNTHESIS, RANDOM)
        }
        told.append(
            f"{rows[0]['title']}: {show(worst[SYNTHESIS], 'percent')} from HCMS, "
            f"{show(worst[RANDOM], 'percent')} from random vectors"
        )
        agree.append(worst[SYNTHESIS] < SIMILAR * worst[RANDOM])
    text = f"Worst eigenvalue after {last} over-relaxed corrections: {'; '.join(told)}."
    return Finding(REPRODUCED if all(agree) else NOT, text, (named(claims, table),))


def total(claims: Claims) -> Finding:
    """Fig. 11: all methods together."""
    design = claims.of_run("design")
    full = claims.in_full("methods")
    told, ratios, tuned = [], [], []
    for base, label in (("slepc", "tuned SLEPc"), ("arpack", "ARPACK in shift-and-invert mode")):
        cold, warm = (speed_ups(full, base, name) for name in ("ddfem_ec", "ddfem_ec_warm"))
        if cold and warm:
            told.append(f"{label}: {ends(cold)} cold, {ends(warm)} warm")
            ratios += [*cold, *warm]
            tuned += cold
    for row in claims.kept.values():
        seconds = row["seconds"]
        plain = seconds["arpack_regular"]
        cold, warm = [plain / seconds["ddfem_ec"]], [plain / seconds["ddfem_ec_warm"]]
        told.append(
            f"ARPACK without a factorisation, {show(plain, 'seconds')} for {row['modes']} modes of "
            f"the {row['model']} of {show(row['dof_fine'], 'count')} unknowns ({row['clock']}): "
            f"{ends(cold)} cold, {ends(warm)} warm"
        )
        ratios += [*cold, *warm]
    if design.rows:
        own = [(row["cold"], row["warm"]) for row in design.rows]
        cold, warm = ([float(each[number]) for each in own] for number in (0, 1))
        told.append(f"SLEPc in this run, smaller: {ends(cold)} cold, {ends(warm)} warm")
        ratios += [*cold, *warm]
        tuned += cold
    if not ratios:
        return Finding(UNMEASURED, "No design was timed in this run.")
    if tuned and min(tuned) >= THREE_ORDERS:
        verdict = REPRODUCED
    else:
        verdict = IN_PART if max(ratios) >= THREE_ORDERS else NOT
    kept = (MEASURED.name,) if claims.kept else ()
    own_table = ("tables/design.json",) if design.rows else ()
    of_full = (named(claims, full),) if full else ()
    return Finding(verdict, f"Faster than {'; '.join(told)}.", (*of_full, *kept, *own_table))


def each(claims: Claims) -> Finding:
    """Section 8.1: coarsening alone, and component mode synthesis with correction alone."""
    full = claims.in_full("methods") or claims.of_run("methods")
    names = {"ddfem": "DDFEM* alone", "hcms_ec": EXACT, "fastest": "--method auto"}
    found = {name: speed_ups(full, "slepc", name) for name in names}
    told = [f"{names[name]} {ends(values)}" for name, values in found.items() if values]
    if not told:
        return Finding(UNMEASURED, "Methods were not timed in this run.")
    verdict = (
        REPRODUCED
        if all(min(found[name] or [0.0]) >= TWO_ORDERS for name in ("ddfem", "hcms_ec"))
        else NOT
    )
    return Finding(verdict, f"Over SLEPc: {', '.join(told)}.", (named(claims, full),))


def interactive(claims: Claims) -> Finding:
    """Section 8.1: seconds of a solve."""
    full = claims.in_full("methods") or claims.of_run("methods")
    cold, warm = (
        [row[name] for row in full.rows if row.get(name) is not None]
        for name in ("ddfem_ec", "ddfem_ec_warm")
    )
    if not cold or not warm:
        return Finding(UNMEASURED, "No design was timed in this run.")
    text = f"{ends(cold, 'seconds')} cold, {ends(warm, 'seconds')} warm."
    verdict = REPRODUCED if max(cold) <= INTERACTIVE else NOT
    return Finding(verdict, text, (named(claims, full),))


def response(claims: Claims) -> Finding:
    """Fig. 12: motion after a strike."""
    coarse, fine = (strikes(claims, VARIANTS[name].label) for name in ("ddfem_hcms_ec", "hcms_ec"))
    text = (
        "Relative difference of the motion over the first periods: on the fine mesh at most "
        f"{show(max(row['difference'] for row in fine), 'percent')}"
    )
    if coarse:
        differences = [row["difference"] for row in coarse]
        text += f", on the coarsened one {ends(differences, 'percent')}"
        if max(differences) <= SIMILAR:
            verdict = REPRODUCED
        else:
            verdict = IN_PART if max(differences) < STILL else NOT
        text += " (100 % is what no motion at all would differ by)"
    else:
        verdict = UNMEASURED
    return Finding(
        verdict,
        f"{text}. Curves are on the pages of the validation.",
        files(claims, "-responses.json"),
    )


def scene(claims: Claims) -> Finding:
    """Fig. 13: spectrograms."""
    strike = strikes(claims, VARIANTS["ddfem_hcms_ec"].label)
    single = (
        f"single strikes, {ends([row['distance_decibels'] for row in strike], 'small')} dB (rms) "
        "apart on the coarsened mesh"
        if strike
        else "single strikes of the fine mesh"
    )
    if claims.scene is None:
        return Finding(
            IN_PART if strike else UNMEASURED,
            f"No scene in this run; {single}, stand on the pages of the validation.",
            files(claims, "-responses.json"),
        )
    apart = [
        f"{row['title']} {show(row['distance_decibels'], 'small')} dB"
        for row in claims.scene.rows
        if row.get("distance_decibels")
    ]
    told = f", off the truth’s by (rms) {', '.join(apart)}" if apart else ""
    text = f"The same scene by each is below{told}; {single}, are on the pages of the validation."
    return Finding(IN_PART, text, (named(claims, claims.scene), *files(claims, "-responses.json")))


MEASURES: dict[str, Callable[[Claims], Finding]] = {
    "shapes": shapes,
    "blocks": blocks,
    "scaling": scaling,
    "evaluation": evaluation,
    "storage": storage,
    "training": training,
    "convergence": convergence,
    "total": total,
    "each": each,
    "interactive": interactive,
    "response": response,
    "scene": scene,
}
"""By the claim's name in `claims.yaml`."""


def by_method(table: Table) -> dict[str, dict[str, Any]]:
    """Rows of the table of blocks by method."""
    return {row["method"]: row for row in table.rows}


def forests_row(rows: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """The row of the forests."""
    return next(row for name, row in rows.items() if name.endswith(", forests"))


def is_fit_of(row: dict[str, Any], forests: dict[str, Any]) -> bool:
    """Whether a row is of the fits that forests learned from."""
    objective = forests["method"].removesuffix(", forests")
    return bool(row["method"] == f"{objective}, fitted on the spot")


def database_row(rows: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """The row of the database of Chen et al."""
    return next(row for name, row in rows.items() if name.endswith(", database"))


def strikes(claims: Claims, method: str) -> list[dict[str, Any]]:
    """Differences of a method's motion and sound from the truth's, of every model that has it."""
    tables = claims.of_model("responses").values()
    return [row for table in tables for row in table.rows if row["method"] == method]


def speed_ups(table: Table | None, base: str, method: str) -> list[float]:
    """Time of a base over that of a method, of every solid that both were timed on."""
    rows = table.rows if table else ()
    return [row[base] / row[method] for row in rows if row.get(base) and row.get(method)]


def ends(values: Iterable[float], kind: str = "times") -> str:
    """Least and greatest value in words."""
    least, most = (show(float(each), kind) for each in (np.min(list(values)), np.max(list(values))))
    return least if least == most else f"{least} to {most}"


def named(claims: Claims, table: Table) -> str:
    """File that a table was read from."""
    return next(name for name, each in claims.read.items() if each is table)


def files(claims: Claims, ending: str) -> tuple[str, ...]:
    """Files of all models with an ending, if any was read, in a word."""
    any_model = any(name.endswith(ending) for name in claims.read)
    return (f"validation/tables/MODEL{ending}",) if any_model else ()
