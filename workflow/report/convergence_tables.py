"""How fast corrections converge from each start (Fig. 10), as a table and in a sentence."""

from collections.abc import Iterator
from typing import Any

from solver.hcms.condense import DEFAULT_INTERFACE
from studies.base.conditions import NOT_TIMED, measured
from studies.base.numbers import show
from studies.base.table import SOLID, Column, Row, Table, solid, table

PAPER, OURS = "relaxation", "krylov"
ACCELERATIONS = {PAPER: "over-relaxed, as in the paper", OURS: "Krylov-accelerated"}
"""Accelerations of the corrections and their names for people."""
SYNTHESIS, RANDOM = f"hcms-{DEFAULT_INTERFACE}", "random"
"""The solver's own start, and one that knows nothing."""


def start_label(start: str) -> str:
    """Name of a start for people.

    Examples
    --------
    >>> start_label("hcms-free"), start_label("random")
    ('HCMS, free interfaces', 'random vectors')
    """
    if start == RANDOM:
        return "random vectors"
    return f"HCMS, {start.removeprefix('hcms-')} interfaces"


MEASURED = measured(
    lambda results: {name: each["provenance"] for name, each in results.convergence.items()},
    NOT_TIMED,
)


@table(
    SOLID,
    Column("modes", "Modes", "count"),
    Column("start", "Start"),
    Column("acceleration", "Corrections"),
    Column("corrections", "made", "count"),
    Column("median", "Median error", "percent"),
    Column("p90", "90 % below", "percent"),
    Column("max", "Worst", "percent"),
    keys="model start acceleration corrections",
    conditions=MEASURED,
)
def convergence(results: Any) -> Iterator[Row]:
    """Relative errors of the elastic eigenvalues against the exact ones, by start, acceleration and
    number of corrections."""
    for model, history in results.convergence.items():
        for curve in history["histories"]:
            for step, errors in enumerate(curve["eigenvalue_error"]):
                yield {
                    **solid(results, model),
                    "modes": history["modes"],
                    "start": start_label(curve["start"]),
                    "acceleration": ACCELERATIONS[curve["acceleration"]],
                    "corrections": step,
                    **errors,
                }


def convergence_sentences(table: Table) -> list[str]:
    """What the table says of each solid, one sentence a solid."""
    return [_sentence(table, model) for model in dict.fromkeys(row["model"] for row in table.rows)]


def _sentence(table: Table, model: str) -> str:
    rows = [row for row in table.rows if row["model"] == model]
    last = max(row["corrections"] for row in rows)
    medians = {tuple(row[key] for key in table.keys[1:]): row["median"] for row in rows}

    def median(start: str, acceleration: str, corrections: int) -> str:
        key = start_label(start), ACCELERATIONS[acceleration], corrections
        return show(medians[key], "percent")

    times = "correction" if last == 1 else "corrections"
    return (
        f"{rows[0]['title']}: from {start_label(SYNTHESIS)}, the median eigenvalue is off by "
        f"{median(SYNTHESIS, PAPER, 0)} before any correction, and after {last} {times} by "
        f"{median(SYNTHESIS, PAPER, last)} as in the paper or {median(SYNTHESIS, OURS, last)} "
        f"Krylov-accelerated; from random vectors, which tell no shift to accelerate with, it is "
        f"{median(RANDOM, PAPER, last)} or {median(RANDOM, OURS, last)}."
    )
