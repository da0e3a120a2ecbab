"""Claims about single blocks (Fig. 9) and about the training of forests."""

from typing import Any

from studies.base.numbers import show
from studies.base.table import Table
from studies.claims.findings import IN_PART, LESS, NOT, REPRODUCED, SIMILAR, UNMEASURED, Finding
from studies.claims.results import Claims
from workflow.report.blocks_tables import LOWER_BOUND

DAY = 86400.0
ROWS_OF_A_FIT = 8
"""A fit is seen from the eight corners of its block."""


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
    shown = [show(value, "fraction") for value in (within, beyond)]
    text = f"{shown[0]} on 0 to 10 GPa, {shown[1]} on 100 to 10,000 GPa."
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
