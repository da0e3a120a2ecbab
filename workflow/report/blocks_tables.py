"""Tables of errors, cost and storage on single blocks, as in Fig. 9 of the paper."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from typing import Any

from workflow.report.conditions import IN_COLUMNS, Repeats
from workflow.report.numbers import show
from workflow.report.table import LEAST, MOST, Column, Table

Row = dict[str, Any]

LOWER_BOUND = "least of any element"

COST = (
    Column("seconds_per_block", "Cost per block", "seconds", "s"),
    Column(f"seconds_per_block{LEAST}", "min", "seconds", "s"),
    Column(f"seconds_per_block{MOST}", "max", "seconds", "s"),
)

MEASURE = (
    "E|u_c − u|² / E|u|², the mean square distance between fine displacements and those of the "
    "coarse element, over the mean square of the fine ones: 0 is exact, 1 is what a rigid element "
    "does, softer elements can exceed it. Nodal: random forces on all nodes, as in the paper; "
    "inertia: that of trilinear motions, which vibration brings."
)


def overview(rows: Sequence[Row], name: str = "blocks") -> Table:
    """One row a coarsening, two columns a kind of blocks.

    Kinds that only scale others are left out, as their errors are the same, and so are methods
    beyond the range that they were made for.

    Parameters
    ----------
    rows : output of `forests table`.
    """
    used = compared(rows)
    kinds = list(dict.fromkeys(map(kind_of, used)))
    columns = [Column("method", "Coarsening")]
    for number, kind in enumerate(kinds):
        columns += [
            Column(f"kind{number}_nodal", f"{kind}: nodal", "fraction"),
            Column(f"kind{number}_nodal_median", f"{kind}: nodal, median", "fraction", shown=False),
            Column(f"kind{number}_inertial", "inertia", "fraction"),
            Column(
                f"kind{number}_inertial_median", f"{kind}: inertia, median", "fraction", shown=False
            ),
        ]
    columns += [
        *COST,
        Column("storage_bytes", "Storage", "bytes", "B"),
        Column("training_seconds", "Made in", "seconds", "s"),
    ]
    methods = dict.fromkeys(map(method_of, used))
    return Table(
        name,
        f"Relative squared displacement error on {rows[0]['blocks']:,} random blocks of each kind, "
        f"mean over the blocks: {MEASURE} Medians are in the CSV file. A database is made for "
        "each kind, its storage and time are those of one; cost on one core, median.",
        columns,
        [
            *(
                _overview_row(method, [r for r in used if method_of(r) == method], kinds)
                for method in methods
            ),
            _least_row(used, kinds),
        ],
    )


def compared(rows: Sequence[Row]) -> list[Row]:
    """Rows whose kind of blocks scales no other, of methods within the range they were made for."""
    return [row for row in rows if row["scaled_by"] == 1.0 and not row["clamped"]]


def kind_of(row: Row) -> str:
    """Range, distribution and fill of the blocks in words."""
    return f"{_range(row)} {row['distribution']}, {row['fill']}"


def _range(row: Row) -> str:
    low, high = row["range_gpa"]
    return f"{low:,g}…{high:,g} GPa"


def method_of(row: Row) -> str:
    """Name of the coarsening without the range that a database is made for."""
    low, high = row["range_gpa"]
    name: str = row["method"]
    return name.removesuffix(f" {low:g}..{high:g} GPa")


def _overview_row(method: str, rows: Sequence[Row], kinds: Sequence[str]) -> Row:
    found: Row = {"method": method}
    for row in rows:
        key = f"kind{kinds.index(kind_of(row))}"
        found |= {
            f"{key}_nodal": row["mean_error"],
            f"{key}_nodal_median": row["median_error"],
            f"{key}_inertial": row["mean_error_inertial"],
            f"{key}_inertial_median": row["median_error_inertial"],
        }
    found |= {
        key: combine(row[key] for row in rows)
        for key, combine in (
            ("seconds_per_block", statistics.median),
            (f"seconds_per_block{LEAST}", min),
            (f"seconds_per_block{MOST}", max),
        )
    }
    found["storage_bytes"] = max(row["storage_bytes"] for row in rows)
    seconds = [row["training_seconds"] for row in rows if row["training_seconds"] is not None]
    found["training_seconds"] = max(seconds, default=None)
    return found


def _least_row(rows: Sequence[Row], kinds: Sequence[str]) -> Row:
    found: Row = {"method": LOWER_BOUND}
    for row in rows:
        key = f"kind{kinds.index(kind_of(row))}"
        found |= {
            f"{key}_nodal": row["min_mean_error"],
            f"{key}_nodal_median": row["min_median_error"],
        }
    return found


def every_row(rows: Sequence[Row], name: str = "every-block") -> Table:
    """All that `forests table` found, row by row."""
    return Table(
        name,
        f"Every coarsening on {rows[0]['blocks']:,} random blocks of each kind, on one core; costs "
        f"are medians. Errors: {MEASURE} Corner: forces on the corners only. Databases beyond the "
        "range that they were made for take their stiffest material.",
        [
            Column("blocks", "Blocks"),
            Column("method", "Coarsening"),
            *(
                Column(f"{kind}_error{load}", label, "small")
                for load, force in (("", "Nodal"), ("_inertial", "Inertia"), ("_corner", "Corner"))
                for kind, label in (("mean", f"{force}, mean"), ("median", "median"))
            ),
            Column("mean_squared_m2", "Nodal, absolute [m²]", "small", "m^2"),
            *COST,
            Column("storage_bytes", "Storage", "bytes", "B"),
            Column("training_seconds", "Made in", "seconds", "s"),
        ],
        [{**row, "blocks": kind_of(row) + _scaled(row)} for row in rows],
        ["blocks", "method"],
    )


def repeats(rows: Sequence[Row]) -> Repeats:
    """How often the cost of a block was measured."""
    return Repeats(f"{rows[0]['timed_runs']} on each kind of blocks, warm", IN_COLUMNS)


def _scaled(row: Row) -> str:
    if row["scaled_by"] == 1.0:
        return ""
    return f" (others times {show(row['scaled_by'], 'count')})"
