"""Tables of errors, cost and storage on single blocks, as in Fig. 9 of the paper."""

from collections.abc import Iterator, Sequence
from typing import Any

import pandas as pd

from studies.base.conditions import IN_COLUMNS, Repeats, measured
from studies.base.table import Column, Row, each, hidden, table

LOWER_BOUND = "least of any element"
ERRORS = {
    "nodal": "mean_error",
    "nodal_median": "median_error",
    "inertial": "mean_error_inertial",
    "inertial_median": "median_error_inertial",
}
"""Errors of a coarsening on a kind of blocks, by the ending of their column."""

MEASURE = (
    "E|u_c − u|² / E|u|², the mean square distance between fine displacements and those of the "
    "coarse element, over the mean square of the fine ones: 0 is exact, 1 is what a rigid element "
    "does, softer elements can exceed it. Nodal: random forces on all nodes, as in the paper; "
    "inertia: that of trilinear motions, which vibration brings."
)


def on_blocks(results: Any) -> list[Row]:
    """Rows of `forests table`."""
    return results.on_blocks["result"]


MEASURED = measured(
    lambda results: {"all": results.on_blocks["provenance"]},
    lambda results: Repeats(
        f"{on_blocks(results)[0]['timed_runs']} on each kind of blocks, warm", IN_COLUMNS
    ),
)


def compared(rows: Sequence[Row]) -> list[Row]:
    """Rows whose kind of blocks scales no other, of methods within the range they were made for."""
    return [row for row in rows if row["scaled_by"] == 1.0 and not row["clamped"]]


def kind_of(row: Row) -> str:
    """Range, distribution and fill of the blocks in words."""
    low, high = row["range_gpa"]
    return f"{low:,g}…{high:,g} GPa {row['distribution']}, {row['fill']}"


def kinds_of(rows: Sequence[Row]) -> list[str]:
    """Kinds of blocks, each once."""
    return list(dict.fromkeys(map(kind_of, rows)))


def method_of(row: Row) -> str:
    """Name of the coarsening without the range that a database is made for."""
    low, high = row["range_gpa"]
    name: str = row["method"]
    return name.removesuffix(f" {low:g}..{high:g} GPa")


@table(
    Column("method", "Coarsening"),
    lambda results: each(
        {f"kind{n}": kind for n, kind in enumerate(kinds_of(compared(on_blocks(results))))},
        Column("{name}_nodal", "{label}: nodal", "fraction"),
        hidden("{name}_nodal_median", "{label}: nodal, median", "fraction"),
        Column("{name}_inertial", "inertia", "fraction"),
        hidden("{name}_inertial_median", "{label}: inertia, median", "fraction"),
    ),
    Column("seconds_per_block", "Cost per block", "seconds"),
    Column("seconds_per_block_min", "min", "seconds"),
    Column("seconds_per_block_max", "max", "seconds"),
    Column("storage_bytes", "Storage", "bytes"),
    Column("training_seconds", "Made in", "seconds"),
    conditions=MEASURED,
    measure=MEASURE,
)
def blocks(results: Any) -> Iterator[Row]:
    """Relative squared displacement error on {on_blocks[result][0][blocks]:count} random blocks of
    each kind, mean over the blocks: {measure} Medians are in the CSV file. A database is made for
    each kind, its storage and time are those of one; cost on one core, median."""
    # Kinds that only scale others are left out, as their errors are the same, and so are methods
    # beyond the range that they were made for.
    used = compared(on_blocks(results))
    keys = {kind: f"kind{number}" for number, kind in enumerate(kinds_of(used))}
    frame = pd.DataFrame(used)
    for method, group in frame.groupby(frame.apply(method_of, axis=1), sort=False):
        trained = group["training_seconds"].dropna()
        yield {
            "method": method,
            **{
                f"{keys[kind_of(row)]}_{ending}": row[error]
                for row in (used[index] for index in group.index)
                for ending, error in ERRORS.items()
            },
            "seconds_per_block": group["seconds_per_block"].median(),
            "seconds_per_block_min": group["seconds_per_block_min"].min(),
            "seconds_per_block_max": group["seconds_per_block_max"].max(),
            "storage_bytes": int(group["storage_bytes"].max()),
            "training_seconds": float(trained.max()) if len(trained) else None,
        }
    least = {"nodal": "min_mean_error", "nodal_median": "min_median_error"}
    yield {"method": LOWER_BOUND} | {
        f"{keys[kind_of(row)]}_{ending}": row[error]
        for row in used
        for ending, error in least.items()
    }
