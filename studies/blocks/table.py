"""Fig. 9: displacement error on random blocks, cost per block and storage of every coarsening.

The error of a block is that of `block_error`: the mean square distance between the fine
displacements and those of its coarse element, interpolated trilinearly to the block's nodes, over
the mean square of the fine displacements, exact for all random forces. A row has its mean and
median over the blocks. It is a ratio of squares: 0 is exact, 1 is what a rigid element does, and
elements that are too soft can exceed 1.
"""

import statistics
import time
from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np

from carillon.arrays import Array
from carillon.command_line.progress import track
from carillon.parameters import option, parameters
from carillon.parameters.quantities import Number, between
from carillon.processes.threads import blas_threads
from forests.evaluate import MOST_BLOCKS
from forests.model import Model
from studies.blocks.block_error import AT_ONCE, Errors, displacement_errors
from studies.blocks.cases import CASES, BlockCase
from studies.blocks.database import MATERIALS, MOST_MATERIALS, Database
from studies.blocks.methods import (
    Method,
    common_poisson,
    database_methods,
    databases_of,
    methods_of,
)

TIMED_BLOCKS, FEWEST_TIMED = 2000, 64
"""Blocks that a run for the cost per block takes, at the most and at the least."""

TIMED_SECONDS = 0.2
"""Time that a timed run is to take, as far as these numbers allow [s]."""

TIMED_RUNS = 5
"""Runs whose median is the cost per block, after one that warms up; min and max are kept too."""

SQUARE_METRES = 1e-18
"""Square of the displacement [m^2] that `block_error` calls 1 when moduli are in GPa.

Forces of variance 1 N^2 in every component, cells of edge 1 m: a displacement is 1 N / (1 GPa m).
Where moduli may come close to zero, a few blocks with the softest cells make up most of this mean,
and no coarsening reaches their displacements; the relative errors weigh all blocks alike.
"""

Row = dict[str, Any]


@parameters
class TableOptions:
    """Blocks that the coarsenings are compared on."""

    blocks: Annotated[int, between(1, MOST_BLOCKS)] = option(10_000, "of each range")
    seed: Number = option(0, "of the blocks")
    materials: Annotated[int, between(2, MOST_MATERIALS)] = option(
        MATERIALS, "base materials of a database"
    )


def cost_per_block(method: Method, young: Array) -> Row:
    """Cost [s] of blocks (n, 8) that are coarsened together on one core, and in how many runs.

    As many as can be in the time are taken, which the first few tell.
    """

    def run(count: int) -> float:
        start = time.perf_counter()
        method.coarsen(young[:count])
        return (time.perf_counter() - start) / min(count, len(young))

    run(1)
    count = min(max(round(TIMED_SECONDS / run(FEWEST_TIMED)), FEWEST_TIMED), TIMED_BLOCKS)
    timed = [run(count) for _ in range(1 + TIMED_RUNS)][1:]
    return {
        "seconds_per_block": statistics.median(timed),
        "seconds_per_block_min": min(timed),
        "seconds_per_block_max": max(timed),
        "timed_runs": TIMED_RUNS,
    }


def summary(errors: Errors) -> Row:
    """Errors over all blocks: mean and median, and the least that any element can reach."""
    nodal, minimum = errors.relative("nodal"), errors.relative_minimum("nodal")
    row = {"mean_error": float(nodal.mean()), "median_error": float(np.median(nodal))}
    for load in ("inertial", "corner"):
        relative = errors.relative(load)
        row[f"mean_error_{load}"] = float(relative.mean())
        row[f"median_error_{load}"] = float(np.median(relative))
    row["min_mean_error"] = float(minimum.mean())
    row["min_median_error"] = float(np.median(minimum))
    row["mean_squared_m2"] = float(errors.squared["nodal"].mean()) * SQUARE_METRES
    return row


def errors_of(young: Array, methods: Sequence[Method], poisson: float, label: str) -> list[Errors]:
    """Errors of all methods on blocks (n, 8), which share one fine solution."""
    moduli = [None if method.flexibility else method.coarsen(young) for method in methods]
    parts: list[list[Errors]] = []
    starts = range(0, len(young), AT_ONCE)
    for start in track(starts, label, len(young), "block", weight=lambda _: AT_ONCE):
        rows = slice(start, start + AT_ONCE)
        coarse = [
            method.response(young[rows]) if values is None else values[rows]
            for method, values in zip(methods, moduli)
        ]
        parts.append(displacement_errors(young[rows], coarse, poisson))
    return [_joined(pieces) for pieces in zip(*parts)]


def _joined(pieces: Sequence[Errors]) -> Errors:
    fields = (
        {load: np.concatenate([part[load] for part in parts]) for load in parts[0]}
        for parts in zip(*pieces)
    )
    return Errors(*fields)


@blas_threads(1)
def table(
    models: dict[str, Model],
    options: TableOptions,
    databases: dict[BlockCase, Database] | None = None,
) -> list[Row]:
    """Rows of Fig. 9 on random blocks of each case, on one core.

    Raises UserError for no model, or models of different Poisson's ratios.

    Parameters
    ----------
    models
        Forests by the names of their files, all of one Poisson's ratio.
    databases
        Of metamaterials, see `studies.blocks.methods.databases_of`; built if not given.

    Returns
    -------
    list of dict
        One row for each case and method: `method`, `range_gpa`, `distribution`, `fill`, `scaled_by`
        (of the case), `mean_error`, `median_error` (nodal forces), the same for inertial and corner
        loads, `min_mean_error`, `min_median_error` (nodal, of any element whatsoever),
        `mean_squared_m2` (absolute, nodal), `seconds_per_block` (median of `timed_runs`, with
        `seconds_per_block_min` and `_max`), `storage_bytes`, `training_seconds` (None if unknown),
        `clamped` (made for lower moduli than the blocks have), `blocks`, `seed`.
    """
    poisson = common_poisson(models)
    if databases is None:
        databases = databases_of(CASES, poisson, materials=options.materials)
    rows: list[Row] = []
    for case in CASES:
        young = case.blocks(options.blocks, options.seed)
        methods = [*methods_of(models), *database_methods(case, databases)]
        errors = errors_of(young, methods, poisson, case.name)
        rows += [_row(case, method, young, each) for method, each in zip(methods, errors)]
        for row in rows:
            row.update(blocks=options.blocks, seed=options.seed)
    return rows


def _row(case: BlockCase, method: Method, young: Array, errors: Errors) -> Row:
    return {
        "method": method.name,
        **case.columns(),
        **summary(errors),
        **cost_per_block(method, young),
        "storage_bytes": method.storage_bytes,
        "training_seconds": method.training_seconds,
        "clamped": method.clamped,
    }


COLUMNS = (
    ("us/block", 9),
    ("MB", 8),
    ("training s", 11),
    ("nodal", 9),
    ("median", 8),
    ("inertial", 9),
    ("median", 8),
    ("corner", 9),
    ("median", 8),
    ("nodal m^2", 11),
)


def as_text(rows: Sequence[Row]) -> str:
    """The rows in aligned columns, case by case."""
    width = 2 + max(len(row["method"]) for row in rows)
    lines = [
        f"E|u_c - u|^2 / E|u|^2 over random forces, mean and median over {rows[0]['blocks']:,} "
        "random blocks",
        "nodal: forces on all nodes; inertial: inertia of trilinear motions; corner: forces on "
        "the corners",
        "nodal m^2: E|u_c - u|^2 for forces of variance 1 N^2 and cells of edge 1 m",
    ]
    shown = None
    for row in rows:
        case = (row["range_gpa"], row["distribution"], row["fill"], row["scaled_by"])
        if case != shown:
            lines += ["", *_heading(row, width)]
            shown = case
        lines.append(_line(row, width))
    return "\n".join(lines)


def _heading(row: Row, width: int) -> list[str]:
    low, high = row["range_gpa"]
    scaled = f", trained range times {row['scaled_by']:g}" if row["scaled_by"] != 1.0 else ""
    return [
        f"{low:g}..{high:g} GPa, {row['distribution']}, {row['fill']}{scaled}; least nodal error "
        f"of any element {row['min_mean_error']:.4f} (median {row['min_median_error']:.4f})",
        "method".ljust(width) + "".join(name.rjust(size) for name, size in COLUMNS),
    ]


def _number(value: float) -> str:
    return f"{value:.4f}" if value < 100.0 else f"{value:.2g}"


def _line(row: Row, width: int) -> str:
    training = row["training_seconds"]
    cells = [
        f"{1e6 * row['seconds_per_block']:.2f}",
        f"{row['storage_bytes'] / 1e6:.2f}",
        "unknown" if training is None else f"{training:.1f}",
        *(
            _number(row[f"{kind}_error{load}"])
            for load in ("", "_inertial", "_corner")
            for kind in ("mean", "median")
        ),
        f"{row['mean_squared_m2']:.4g}",
    ]
    sizes = (size for _, size in COLUMNS)
    return row["method"].ljust(width) + "".join(
        cell.rjust(size) for cell, size in zip(cells, sizes)
    )
