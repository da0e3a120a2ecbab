"""Tables of the training data and of the forests' quality."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from workflow.studies.base.entry import Row
from workflow.studies.report.results import Run

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


def training(run: Run) -> Iterator[Row]:
    """Counts and held-out scores."""
    shards = list(run.shards.values())
    if shards:
        sizes = [shard["samples"][1] - shard["samples"][0] for shard in shards]
        drawn = {
            f"{shard['distribution']} {shard['range'][0]:g}…{shard['range'][1]:g} GPa"
            for shard in shards
        }
        means = {
            "converged": "… whose fit converged",
            "partly_void": "… that are partly void",
            "at_floor": "… moduli that ended at the floor",
        }
        yield _row("distributions", "Distributions of the moduli", "text", ", ".join(sorted(drawn)))
        yield _row("fits", "Blocks drawn and fitted", "count", sum(sizes))
        for key, label in means.items():
            mean = np.average([shard[key] for shard in shards], weights=sizes)
            yield _row(key, label, "share", float(mean))
    yield from scores_rows(run.forests)


def scores_rows(forests: dict[str, Any]) -> Iterator[Row]:
    """Scores and size of forests, from the output of `forests inspect`."""
    # The number of leaves stands beside the memory, below.
    scores = {name: value for name, value in forests["scores"].items() if name != "leaves"}
    known = [name for name in LABELS if name in scores]
    for name in known + [name for name in scores if name not in LABELS]:
        kinds = (kind for start, kind in SCORE_KINDS.items() if name.startswith(start))
        label = LABELS.get(name, name.replace("_", " "))
        yield _row(name, label, next(kinds, "percent"), scores[name])
    seconds = forests["provenance"].get("training_seconds")
    yield _row("trees", "Trees of each of the two forests", "count", forests["trees"])
    yield _row("leaves", "Leaves", "count", forests["leaves"])
    yield _row("memory_bytes", "Memory", "bytes", forests["memory_bytes"])
    yield _row("training_seconds", "Time of the training", "seconds", seconds)


def _row(key: str, label: str, kind: str, value: Any) -> Row:
    return {"key": key, "quantity": label, "value": value, "value_kind": kind}
