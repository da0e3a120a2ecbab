"""Tables of the study of the forests, by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from workflow.forests_study import cost_tables
from workflow.forests_study.results import MEASUREMENTS, ForestsStudy, Row
from workflow.report import blocks_tables
from workflow.report.conditions import ONE_COLD_RUN, Conditions, conditions
from workflow.report.evidence_tables import provenance_table
from workflow.report.forests_tables import scores_rows, scores_table
from workflow.report.table import Column, Table

SCORES = (
    ("rms_log_solid", "rms of log E, solid", "fraction"),
    ("rms_log_partly_void", "rms of log E, partly void", "fraction"),
    ("median_error", "median error of E", "percent"),
    ("r2_log", "R² of log E", "score"),
)
"""What is shown of the scores on one distribution: key, label, kind."""

SCORED = (
    "Scores are on fresh blocks that no training has seen, by distribution of their moduli: rms of "
    "the error of log E over solid and over partly void blocks, median relative error of a "
    "modulus E, and R² of log E; all against the fit that is learned."
)


def model(study: ForestsStudy) -> Table:
    """Size and held-out scores of the forests studied."""
    found = study.model
    return scores_table(
        "model",
        f"The forests studied ({found['path']}): objective {found['objective']}, Poisson’s ratio "
        f"{found['poisson']:g}. Held-out blocks were not used in training.",
        scores_rows(found),
    )


def blocks(study: ForestsStudy) -> Table:
    """Errors on single blocks, a row a coarsening."""
    return _on_blocks(blocks_tables.overview(study.blocks), study)


def every_block(study: ForestsStudy) -> Table:
    """Errors on single blocks, a row a coarsening and kind of blocks."""
    return _on_blocks(blocks_tables.every_row(study.blocks), study)


def _on_blocks(table: Table, study: ForestsStudy) -> Table:
    repeats = blocks_tables.repeats(study.blocks)
    return replace(
        table, conditions=conditions({"all": study.record("blocks")}, study.config, repeats)
    )


def variants(study: ForestsStudy) -> Table:
    """Ways to train."""
    return _scored(
        "variants",
        "Ways to train, on the same rows and with the same storage, so little that all fill it; "
        f"“the same” refers to the training of the default forests. {SCORED}",
        Column("variant", "Training"),
        study.variants,
        conditions({"all": study.record("variants")}, study.config, ONE_COLD_RUN),
    )


def curve(study: ForestsStudy) -> Table:
    """Learning curve."""
    return _scored(
        "curve",
        f"The same training on more and more rows, eight to a block. {SCORED}",
        Column("rows", "Rows", "count"),
        study.curve,
        conditions({"all": study.record("curve")}, study.config, ONE_COLD_RUN),
    )


def _scored(
    name: str, caption: str, first: Column, found: Sequence[Row], measured: Conditions | None
) -> Table:
    distributions = list(found[0]["scores"])
    columns = [
        first,
        Column("training_rows", "Rows trained on", "count", shown=first.key != "rows"),
        Column("leaves", "Leaves", "count"),
        Column("storage_bytes", "Storage", "bytes", "B"),
        Column("training_seconds", "Training", "seconds", "s"),
    ]
    for number, distribution in enumerate(distributions):
        for index, (key, label, kind) in enumerate(SCORES):
            head = f"{_spelt(distribution)}: {label}" if index == 0 else label
            columns.append(Column(f"scores{number}_{key}", head, kind))
    return Table(
        name,
        caption,
        columns,
        [_scored_row(row, distributions) for row in found],
        conditions=measured,
    )


def _scored_row(row: Row, distributions: Sequence[str]) -> dict[str, Any]:
    return row | {
        f"scores{number}_{key}": row["scores"][distribution].get(key)
        for number, distribution in enumerate(distributions)
        for key, _, _ in SCORES
    }


def _spelt(distribution: str) -> str:
    return distribution.replace("..", "…")


def provenance(study: ForestsStudy) -> Table:
    """Command, code and machine behind the forests, and behind their study."""
    return provenance_table(
        {
            study.model["path"]: study.model["provenance"],
            **{f"forests_study/{name}.json": study.record(name) for name in MEASUREMENTS},
        }
    )


BUILDERS: dict[str, Callable[[ForestsStudy], Table]] = {
    "model": model,
    "blocks": blocks,
    "every-block": every_block,
    "variants": variants,
    "curve": curve,
    "cost": cost_tables.cost,
    "sizes": cost_tables.sizes,
    "provenance": provenance,
}


def build_tables(study: ForestsStudy) -> list[Table]:
    """Build every table of the study."""
    return [build(study) for build in BUILDERS.values()]
