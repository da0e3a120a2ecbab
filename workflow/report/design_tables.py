"""What an evaluation of a design takes beside SLEPc: the headline of a report, and its costs."""

from collections.abc import Iterator, Mapping
from typing import Any

from solver.files.modes_file import FINE_TAKEN
from studies.base.numbers import show
from studies.base.table import SOLID, Column, Row, Table, hidden, solid, table
from workflow.report.methods_tables import MEASURED as MEASURED

NEEDED = ("slepc", "ddfem_rough", "ddfem_ec", "ddfem_ec_warm")
"""Methods without which a solid has no row."""
GOAL_RMS, GOAL_WORST = 0.05, 0.15
"""Errors of frequencies that coarse models are refined to by default: rms, worst."""
QUANTITIES = ("cold", "warm", "cold_same", "warm_same", "fine", "error")
"""Columns that the headline tells the median and the range of."""


@table(
    SOLID,
    hidden("resolution", "Voxels along it", "count"),
    hidden("modes", "Modes", "count"),
    Column("unknowns", "Unknowns", "count", source="dof_fine"),
    Column("coarse_unknowns", "coarsened", "count", source="dof_coarse"),
    hidden("precompute", "Precomputation", "seconds", source="seconds.precompute"),
    Column("slepc", "SLEPc, fine", "seconds", source="seconds.slepc"),
    Column("slepc_coarse", "SLEPc, coarse", "seconds", source="seconds.ddfem_rough"),
    Column("cold_seconds", "Cold", "seconds", source="seconds.ddfem_ec"),
    Column("warm_seconds", "Warm", "seconds", source="seconds.ddfem_ec_warm"),
    Column("cold", "Speed-up: cold, fine", "times"),
    Column("warm", "warm, fine", "times"),
    Column("cold_same", "cold, coarse", "times"),
    Column("warm_same", "warm, coarse", "times"),
    Column("error", "Error, rms", "percent", source="frequency_error.ddfem.rms_7_60"),
    Column("worst", "worst", "percent"),
    hidden("average_error", "if averaged", "percent", source="frequency_error.average.rms_7_60"),
    Column("solver_error", "Eigenvalue, worst", "percent"),
    hidden("rival_error", "by SLEPc, coarse", "percent", source="eigenvalue_error.ddfem_rough.max"),
    Column("fine", "fine mesh", "times"),
    hidden("fine_error", "Worst eigenvalue", "percent"),
    conditions=MEASURED,
)
def design(results: Any) -> Iterator[Row]:
    """What a design solves again for every material, from moduli to modes: coarsening by the
    forests, and the coarse model to an eigenvalue error of 10⁻², from nothing (cold) and from the
    modes of a material 5 % apart (warm). SLEPc on the fine mesh is what would be solved instead,
    SLEPc on the coarse mesh the same problem to the same 10⁻². The error is that of the coarse
    model, of frequencies 7–60 beside SLEPc on the fine mesh; what the solvers add to it is told in
    eigenvalues, SLEPc’s in the CSV file. The last column is the speed-up of method auto on the fine
    mesh, both to 10⁻⁶."""
    for model, row in results.methods.items():
        seconds = row["seconds"]
        if any(seconds.get(name) is None for name in NEEDED):
            continue
        errors, fine = row["eigenvalue_error"], seconds.get("fastest")
        yield {
            **row,
            **solid(results, model),
            "cold": seconds["slepc"] / seconds["ddfem_ec"],
            "warm": seconds["slepc"] / seconds["ddfem_ec_warm"],
            "cold_same": seconds["ddfem_rough"] / seconds["ddfem_ec"],
            "warm_same": seconds["ddfem_rough"] / seconds["ddfem_ec_warm"],
            "worst": abs(row["frequency_error"]["ddfem"]["worst_7_60"]),
            "solver_error": max(errors[name]["max"] for name in ("ddfem_ec", "ddfem_ec_warm")),
            "fine": None if fine is None else seconds["slepc"] / fine,
            "fine_error": None if fine is None else errors["fastest"]["max"],
        }


def spread_of(table: Table, key: str) -> tuple[float, float, float] | None:
    """Median, least and greatest of a column over the solids; None of nothing.

    Examples
    --------
    >>> rows = [{"cold": 3.0}, {"cold": 9.0}, {"cold": 4.0}]
    >>> spread_of(Table("design", "", [], rows), "cold")
    (4.0, 3.0, 9.0)
    """
    values = sorted(row[key] for row in table.rows if row.get(key) is not None)
    if not values:
        return None
    middle = len(values) // 2
    median = values[middle] if len(values) % 2 else (values[middle - 1] + values[middle]) / 2
    return median, values[0], values[-1]


def costs(tables: Mapping[str, Table], refine_to: float | None = None) -> list[str]:
    """What the method costs and where it does not pay, a sentence or two each.

    `refine_to` is the error that blocks are kept fine for, 0 if none is; None for the default.
    """
    parts = (
        _preparation(tables),
        _price_of_coarse_elements(tables),
        _single_spectra(tables, GOAL_RMS if refine_to is None else refine_to),
    )
    return [sentence for sentence in parts if sentence]


def _preparation(tables: Mapping[str, Table]) -> str:
    trained = [row["training_seconds"] for row in tables["blocks"].rows if _is_forest(row)]
    before = spread_of(tables["design"], "precompute")
    parts = []
    if trained and trained[0]:
        parts.append(
            f"training the forests took {show(trained[0], 'seconds')}, once for all solids"
        )
    if before:
        parts.append(
            f"a solid needs {_ranged(before, 'seconds')} once, for voxels, blocks and elimination "
            "plans, whatever its material"
        )
    return f"Beforehand: {'; '.join(parts)}." if parts else ""


def _is_forest(row: Row) -> bool:
    return str(row["method"]).endswith(", forests")


def _price_of_coarse_elements(tables: Mapping[str, Table]) -> str:
    error = spread_of(tables["design"], "error")
    if error is None:
        return ""
    rough = [
        "{} ({} rms, worst {})".format(
            row["title"], *(show(row[key], "percent") for key in ("error", "worst"))
        )
        for row in tables["design"].rows
        if row["error"] > GOAL_RMS or row["worst"] > GOAL_WORST
    ]
    return (
        f"The coarse mesh costs accuracy: frequencies 7–60 are off by {_ranged(error, 'percent')} "
        f"rms. More than {show(GOAL_RMS, 'percent')} rms or {show(GOAL_WORST, 'percent')} worst: "
        f"{'; '.join(rough) if rough else 'none of the solids'}. A design checks itself on the "
        "fine model for that."
    )


def _single_spectra(tables: Mapping[str, Table], goal: float) -> str:
    rows = [row for row in tables["summary"].rows if row.get("speed_up") is not None]
    if not rows:
        return ""
    fallen = [row for row in rows if row["coarse_unknowns"] >= row["unknowns"]]
    slower = [row for row in rows if row["speed_up"] < 1.0]
    ratios = spread_of(tables["summary"], "speed_up")
    assert ratios is not None
    accuracy = (
        f"A single spectrum to {100.0 * goal:g} % is another matter: its error is estimated, and "
        "blocks that coarse elements cannot follow stay fine."
        if goal > 0.0
        else "Single spectra are those of coarse elements throughout, however far off."
    )
    sentences = [
        f"{accuracy} One cold run each, with other runs beside it, was "
        f"{_ranged(ratios, 'times')} as fast as SLEPc’s ground truth (table below)."
    ]
    if fallen:
        names = "; ".join(map(_fallen, fallen))
        sentences.append(f"Coarsening would not have paid, and the fine model was solved: {names}.")
    if slower:
        sentences.append(f"It did not pay: {'; '.join(map(_slow, slower))}.")
    else:
        sentences.append("It was slower than SLEPc on none of the solids.")
    return " ".join(sentences)


def _fallen(row: Row) -> str:
    reason = row.get(FINE_TAKEN)
    return f"{row['title']} ({reason})" if reason else str(row["title"])


def _slow(row: Row) -> str:
    kept = f"{row['coarse_unknowns']:,} of {row['unknowns']:,} unknowns"
    return f"{row['title']} ({show(row['speed_up'], 'times')}, {kept} left)"


def _ranged(spread: tuple[float, float, float], kind: str) -> str:
    median, least, most = (show(value, kind) for value in spread)
    return median if least == most else f"{median} ({least} to {most})"
