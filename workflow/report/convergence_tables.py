"""How fast corrections converge from each start (Fig. 10), as a table and in a sentence."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from solver.hcms.condense import DEFAULT_INTERFACE
from workflow.report.numbers import show
from workflow.report.table import Column, Table

PAPER, OURS = "relaxation", "krylov"
ACCELERATIONS = {PAPER: "over-relaxed, as in the paper", OURS: "Krylov-accelerated"}
"""How corrections are accelerated, and the names of that for people."""
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


def convergence(found: Mapping[str, dict[str, Any]], titles: Mapping[str, str]) -> Table:
    """Errors of the elastic eigenvalues after each correction.

    Parameters
    ----------
    found : output of `solver convergence` by model.
    titles : names for people by model.
    """
    return Table(
        "convergence",
        "Relative errors of the elastic eigenvalues against the exact ones, by start, "
        "acceleration and number of corrections.",
        [
            Column("model", "Model", shown=False),
            Column("title", "Solid"),
            Column("modes", "Modes", "count"),
            Column("start", "Start"),
            Column("acceleration", "Corrections"),
            Column("corrections", "made", "count"),
            Column("median", "Median error", "percent"),
            Column("p90", "90 % below", "percent"),
            Column("max", "Worst", "percent"),
        ],
        [
            {
                "model": model,
                "title": titles[model],
                "modes": history["modes"],
                "start": start_label(curve["start"]),
                "acceleration": ACCELERATIONS[curve["acceleration"]],
                "corrections": step,
                **errors,
            }
            for model, history in found.items()
            for curve in history["histories"]
            for step, errors in enumerate(curve["eigenvalue_error"])
        ],
        ["model", "start", "acceleration", "corrections"],
    )


def convergence_sentences(table: Table) -> list[str]:
    """What the table says of each solid, one sentence a solid."""
    return [_sentence(table, model) for model in dict.fromkeys(row["model"] for row in table.rows)]


def _sentence(table: Table, model: str) -> str:
    rows = [row for row in table.rows if row["model"] == model]
    last = max(row["corrections"] for row in rows)

    def median(start: str, acceleration: str, corrections: int) -> str:
        for row in rows:
            if (row["start"], row["acceleration"], row["corrections"]) == (
                start_label(start),
                ACCELERATIONS[acceleration],
                corrections,
            ):
                return show(row["median"], "percent")
        raise KeyError((start, acceleration, corrections))

    times = "correction" if last == 1 else "corrections"
    return (
        f"{rows[0]['title']}: from {start_label(SYNTHESIS)}, the median eigenvalue is off by "
        f"{median(SYNTHESIS, PAPER, 0)} before any correction, and after {last} {times} by "
        f"{median(SYNTHESIS, PAPER, last)} as in the paper or {median(SYNTHESIS, OURS, last)} "
        f"Krylov-accelerated; from random vectors it is {median(RANDOM, PAPER, last)} or "
        f"{median(RANDOM, OURS, last)}."
    )
