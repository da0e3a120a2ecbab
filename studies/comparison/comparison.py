"""Two folders of results side by side."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from studies.comparison.cells import ENDS, KEYS, SHOWN, cells_of, rows_of
from studies.comparison.differences import Difference, of_conditions, of_configurations
from studies.comparison.folders import Folder
from studies.comparison.noise import SAME, VERDICTS, Value, verdict

APART = "/provenance"
"""Endings of paths of tables that are shown as conditions instead."""
SIDES = ("before", "now")


@dataclass(frozen=True)
class Comparison:
    """Everything that two folders have in common, and what only one of them has."""

    before: Folder
    now: Folder
    """The baseline and the other folder."""
    cells: pd.DataFrame
    """Values of both: `KEYS`, `label` for people, `kind`, those of both `SIDES` with their `ENDS`
    and `SHOWN`, the `ratio` of both where that says something, and the `verdict`."""
    moved: pd.DataFrame
    """Values that are not the same any more, the worst first."""
    conditions: list[Difference]
    configuration: list[Difference]
    """What differs of them."""
    only_before: list[str]
    only_now: list[str]
    """Tables, rows and columns of one folder alone, in words."""


def compare(before: Folder, now: Folder) -> Comparison:
    """Set two folders side by side."""
    old, new = _cells(before, "before"), _cells(now, "now")
    cells = new.merge(old.drop(columns=["label", "kind"]), on=KEYS)
    pairs = list(zip(*(map(Value, *(cells[f"{side}{end}"] for end in ENDS)) for side in SIDES)))
    cells["ratio"] = pd.Series([_ratio(*pair) for pair in pairs], dtype=object)
    verdicts = [verdict(kind, *pair) for kind, pair in zip(cells["kind"], pairs)]
    cells["verdict"] = pd.Series(verdicts, dtype=object)
    moved = cells[cells["verdict"] != SAME]
    ratio = pd.to_numeric(moved["ratio"]).fillna(1.0).abs().replace(0.0, 1.0)
    worst = np.lexsort((-np.maximum(ratio, 1.0 / ratio), moved["verdict"].map(VERDICTS.index)))
    return Comparison(
        *(before, now, cells, moved.iloc[worst]),
        *(of_conditions(before, now), of_configurations(before, now)),
        *(list(_only(before, now)), list(_only(now, before))),
    )


def _cells(folder: Folder, side: str) -> pd.DataFrame:
    tables = [each for each in folder.tables.items() if not each[0].endswith(APART)]
    columns = [*KEYS, "label", "kind", *(f"{side}{end}" for end in (*ENDS, SHOWN))]
    cells = [cell for each in tables for cell in cells_of(*each)]
    return pd.DataFrame(cells, columns=columns, dtype=object).dropna(subset="label")


def _ratio(before: Value, now: Value) -> float | None:
    """A number over that of the baseline; None where that says nothing."""
    old, new = before.value, now.value
    if isinstance(old, str) or isinstance(new, str) or not old or new is None:
        return None
    return new / old


def _only(here: Folder, there: Folder) -> Iterator[str]:
    yield from (f"table {path}" for path in here.tables if path not in there.tables)
    for path, table in here.tables.items():
        if path in there.tables and not path.endswith(APART):
            rows, others = rows_of(table), rows_of(there.tables[path])
            yield from (f"{path}: row {name}" for name in rows if name not in others)
            known = {column.key for column in there.tables[path].columns}
            columns = [column.key for column in table.columns]
            yield from (f"{path}: column {key}" for key in columns if key not in known)
