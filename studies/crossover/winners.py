"""From runs to the fastest method of every cell, and to what that says, in sentences.

A cell, which the page calls a case, is a solid with a number of modes, on some ranks of a machine,
to a tolerance. Only methods whose eigenvalues are within the tolerance compete in it.
"""

from collections.abc import Iterator
from typing import Any

import pandas as pd

from studies.base.numbers import show
from studies.crossover.methods import CORRECTED, METHODS, PLAIN, REFERENCE
from studies.crossover.results import YES

PANEL = ["machine", "nodes", "ranks", "latency", "tolerance"]
"""Columns that tell the tables of the page apart."""
CELL = [*PANEL, "unknowns", "title", "modes"]
"""Columns that tell cells apart."""
AS_FAST = 1.1
"""Times the seconds of the fastest within which a method counts as fast as it."""


def fastest(runs: pd.DataFrame) -> pd.DataFrame:
    """The fastest method of every cell that has one, in the order of `CELL`.

    Columns beside `CELL`: `method` and its `label`, `seconds`, the `second` method and its
    `times_second` of these seconds, those of SLEPc (`times_slepc`), of the choice of `auto`
    (`times_auto`, its label `auto`), of HCMS without and with correction (`times_hcms`,
    `times_hcms_ec`) and the former's `error`; NaN or None for what was not run, or failed.
    """
    groups = runs.groupby(CELL, dropna=False) if len(runs) else ()
    rows = [{**dict(zip(CELL, key)), **_contest(cell)} for key, cell in groups]
    table = pd.DataFrame(rows)
    return table.dropna(subset=["method"]) if len(table) else table


def _contest(cell: pd.DataFrame) -> dict[str, Any]:
    ended = cell.dropna(subset=["seconds"]).sort_values("seconds")
    within = ended[ended["reached"] == YES]
    if within.empty:
        return {"method": None}
    first, seconds = within.iloc[0], dict(zip(ended["method"], ended["seconds"]))
    second = within.iloc[1] if len(within) > 1 else None
    chosen = cell.loc[cell["auto"] == YES, "method"].tolist()
    kept = set(within["method"]).intersection(chosen)

    def times(method: str) -> float | None:
        return seconds[method] / first["seconds"] if method in seconds else None

    return {
        "method": first["method"],
        "label": first["label"],
        "seconds": first["seconds"],
        "second": None if second is None else second["label"],
        "times_second": None if second is None else second["seconds"] / first["seconds"],
        "times_slepc": times(REFERENCE),
        "auto": METHODS[chosen[0]].label if chosen else None,
        "times_auto": times(chosen[0]) if kept else None,
        "times_hcms": times(PLAIN),
        "times_hcms_ec": times(CORRECTED),
        "error": next(iter(ended.loc[ended["method"] == PLAIN, "error"]), None),
    }


def by_method(runs: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """Of every method over all cells: runs, how many ended and reached the tolerance, wins, and
    the median and the largest ratio of its seconds to the fastest where it reached it.
    """
    best = fastest(runs)
    if best.empty:
        return
    every = runs.merge(best[[*CELL, "method", "seconds"]], on=CELL, suffixes=("", "_best"))
    for method in METHODS:
        own = every[every["method"] == method]
        within = own[own["reached"] == YES]
        if own.empty:
            continue
        times = within["seconds"] / within["seconds_best"]
        yield {
            "method": method,
            "label": METHODS[method].label,
            "runs": len(own),
            "ended": int(own["seconds"].notna().sum()),
            "reached": len(within),
            "wins": int((own["method"] == own["method_best"]).sum()),
            "times_median": times.median() if len(times) else None,
            "times_worst": times.max() if len(times) else None,
        }


def verdict(runs: pd.DataFrame) -> list[str]:
    """Sentences: who is the fastest, where the paper's method is and where not, and `auto`."""
    best = fastest(runs)
    if best.empty:
        return ["No method has reached its tolerance anywhere."]
    counts = best["label"].value_counts()
    shares = ", ".join(f"{label} in {count}" for label, count in counts.items())
    return [
        f"Of {_cells(len(best))}, the fastest method is {shares}.",
        _plain(runs, best),
        _corrected(best),
        _auto(best),
    ]


def _plain(runs: pd.DataFrame, best: pd.DataFrame) -> str:
    own = best.dropna(subset=["error"])
    if own.empty:
        return "HCMS without correction was not run."
    errors = _range(own["error"], "small")
    ran = runs[(runs["method"] == PLAIN) & (runs["reached"] == YES)]
    reached, won = own.merge(ran[CELL], on=CELL), own[own["method"] == PLAIN]
    begin = f"HCMS without correction has eigenvalue errors of {errors} at the worst mode"
    if reached.empty:
        faster = int((own["times_hcms"] < 1).sum())
        return (
            f"{begin}, and so misses every tolerance. It takes less time than the winner in "
            f"{faster} of {_cells(len(own))}."
        )
    wins = f"wins {len(won)} of these: {_span(won)}" if len(won) else "wins none of these"
    return f"{begin}, within the tolerance in {len(reached)} of {_cells(len(own))}; it {wins}."


def _corrected(best: pd.DataFrame) -> str:
    own = best.dropna(subset=["times_hcms_ec"])
    if own.empty:
        return "HCMS + EC was not run."
    won, lost = own[own["method"] == CORRECTED], own[own["method"] != CORRECTED]
    sentence = f"HCMS + EC wins {len(won) or 'none'} of {_cells(len(own))}"
    sentence += f": {_span(won)}" if len(won) else ""
    if lost.empty:
        return f"{sentence}."
    times, worst = lost["times_hcms_ec"], lost.loc[lost["times_hcms_ec"].idxmax()]
    return (
        f"{sentence}; {'elsewhere ' if len(won) else ''}it takes {_range(times, 'times')} the "
        f"time of the fastest, the most at {_span_of(worst)}."
    )


def _auto(best: pd.DataFrame) -> str:
    own = best.dropna(subset=["times_auto"])
    if own.empty:
        return "What auto chooses was not run, or missed its tolerance."
    good = int((own["times_auto"] <= AS_FAST).sum())
    sentence = "The method that auto chooses is the fastest, or takes 10 % more at most, in "
    sentence += f"{good} of {_cells(len(own))}"
    if good == len(own):
        return f"{sentence}."
    worst = own.loc[own["times_auto"].idxmax()]
    return (
        f"{sentence}; its worst choice is {worst['auto']} instead of {worst['label']}, "
        f"{show(worst['times_auto'], 'times')} its time, at {_span_of(worst)}."
    )


def _cells(count: int) -> str:
    return f"{count} case{'s' * (count != 1)}"


def _span_of(row: pd.Series) -> str:
    return _span(row.to_frame().T)


def _span(cells: pd.DataFrame) -> str:
    """Where cells are, in a few words: from the least to the greatest of everything."""
    keys = ["unknowns", "modes", "ranks", *(["nodes"] if (cells["nodes"] > 1).any() else [])]
    counts = [
        f"{_range(cells[key], 'count')} {key[:-1] if cells[key].max() == 1 else key}"
        for key in keys
    ]
    ends = (cells["tolerance"].min(), cells["tolerance"].max())
    return f"{', '.join(counts)}, tolerance {' to '.join(dict.fromkeys(map(in_words, ends)))}"


def in_words(tolerance: float) -> str:
    """A tolerance as it is spelt in a configuration, or as a power of ten.

    Examples
    --------
    >>> in_words(0.01), in_words(1e-6)
    ('0.01', '10⁻⁶')
    """
    return f"{tolerance:g}" if tolerance >= 1e-3 else show(tolerance, "small")


def _range(values: pd.Series, kind: str) -> str:
    """The least and the greatest value as of a kind of number, once if they read the same."""
    return " to ".join(dict.fromkeys(show(each, kind) for each in (values.min(), values.max())))
