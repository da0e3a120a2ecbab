"""Tables of the training data and of the forests' quality."""

from __future__ import annotations

from typing import Any

import numpy as np

from workflow.report.results import Results
from workflow.report.table import KIND, Column, Table

LABELS = {
    "training_samples": "Blocks trained on",
    "held_out_samples": "Blocks held out",
    "median_error": "Median relative error of a modulus, held-out blocks",
    "median_error_solid": "… of solid blocks",
    "median_error_partly_void": "… of partly void blocks",
    "r2_log": "R² of the logarithm of the modulus, held-out blocks",
    "r2_log_solid": "… of solid blocks",
    "r2_log_partly_void": "… of partly void blocks",
    "rms_log": "Rms error of the logarithm of the modulus, held-out blocks",
    "rms_log_solid": "… of solid blocks",
    "rms_log_partly_void": "… of partly void blocks",
    "uniform_solid": "Error on uniform solid blocks",
    "uniform_partly_void": "Error on uniform partly void blocks",
    "depth": "Largest depth of a tree",
}
"""Scores of `forests inspect` for people; a score without a label is shown by its own name."""


SCORE_KINDS = {
    "training_samples": "count",
    "held_out_samples": "count",
    "depth": "count",
    "r2": "score",
    "rms_log": "fraction",
}
"""Kinds of scores by how their names begin; the others are errors in per cent."""


def training(results: Results) -> Table:
    """Counts and held-out scores."""
    forests = results.forests
    rows = _data_rows(results) if results.shards else []
    return scores_table(
        "training",
        f"Training data (objective {forests['objective']}) and forests. Held-out blocks were not "
        "used in training.",
        rows + scores_rows(forests),
    )


def _data_rows(results: Results) -> list[dict[str, Any]]:
    shards = list(results.shards.values())
    return [
        _row("distributions", "Distributions of the moduli", "text", _distributions(results)),
        _row("fits", "Blocks drawn and fitted", "count", _fits(shards)),
        _row("converged", "… whose fit converged", "share", _mean(shards, "converged")),
        _row("partly_void", "… that are partly void", "share", _mean(shards, "partly_void")),
        _row("at_floor", "… moduli that ended at the floor", "share", _mean(shards, "at_floor")),
    ]


def scores_rows(forests: dict[str, Any]) -> list[dict[str, Any]]:
    """Scores and size of forests, from the output of `forests inspect`."""
    # The number of leaves stands beside the memory, below.
    scores = {name: value for name, value in forests["scores"].items() if name != "leaves"}
    known = [name for name in LABELS if name in scores]
    others = [name for name in scores if name not in LABELS]
    return [
        *(_score(name, scores[name]) for name in known + others),
        _row("trees", "Trees of each of the two forests", "count", forests["trees"]),
        _row("leaves", "Leaves", "count", forests["leaves"]),
        _row("memory_bytes", "Memory", "bytes", forests["memory_bytes"]),
        _row(
            "training_seconds",
            "Time of the training",
            "seconds",
            forests["provenance"].get("training_seconds"),
        ),
    ]


def scores_table(name: str, caption: str, rows: list[dict[str, Any]]) -> Table:
    """Table of quantities, one a row."""
    return Table(
        name,
        caption,
        [
            Column("key", "Key", shown=False),
            Column("quantity", "Quantity"),
            Column("value", "Value"),
            Column(f"value{KIND}", "Its kind", shown=False),
        ],
        rows,
    )


def _row(key: str, label: str, kind: str, value: Any) -> dict[str, Any]:
    return {
        "key": key,
        "quantity": label,
        "value": value,
        f"value{KIND}": kind,
    }


def _score(name: str, value: float) -> dict[str, Any]:
    kind = next((kind for start, kind in SCORE_KINDS.items() if name.startswith(start)), "percent")
    return _row(name, LABELS.get(name, name.replace("_", " ")), kind, value)


def _distributions(results: Results) -> str:
    drawn = {
        f"{shard['distribution']} {shard['range'][0]:g}…{shard['range'][1]:g} GPa"
        for shard in results.shards.values()
    }
    return ", ".join(sorted(drawn))


def _fits(shards: list[dict[str, Any]]) -> int:
    return sum(shard["samples"][1] - shard["samples"][0] for shard in shards)


def _mean(shards: list[dict[str, Any]], key: str) -> float:
    weights = [shard["samples"][1] - shard["samples"][0] for shard in shards]
    return float(np.average([shard[key] for shard in shards], weights=weights))
