"""Tables of the training data and of the forests' quality."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from carillon.files.yaml_input import read_own_yaml
from studies.base.table import Column, Row, hidden, table
from workflow.report.results import Run

SCORES = read_own_yaml(Path(__file__).with_name("scores.yaml"))


@table(
    hidden("key", "Key"),
    Column("quantity", "Quantity"),
    Column("value", "Value"),
    hidden("value_kind", "Its kind"),
)
def training(run: Run) -> Iterator[Row]:
    """Training data (objective {forests[objective]}) and forests. Held-out blocks were not used in
    training. A block is 2×2×2 voxels: solid if the body fills all eight, partly void if one to
    seven of them are empty, as at the surface; scores of partly void blocks are of these alone."""
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
    labels = {name: label for name, label in SCORES["labels"].items() if name in scores}
    for name in dict.fromkeys([*labels, *scores]):
        kinds = (kind for start, kind in SCORES["kinds"].items() if name.startswith(start))
        label = labels.get(name, name.replace("_", " "))
        yield _row(name, label, next(kinds, "percent"), scores[name])
    seconds = forests["provenance"].get("training_seconds")
    yield _row("trees", "Trees of each of the two forests", "count", forests["trees"])
    yield _row("leaves", "Leaves", "count", forests["leaves"])
    yield _row("memory_bytes", "Memory", "bytes", forests["memory_bytes"])
    yield _row("training_seconds", "Time of the training", "seconds", seconds)


def _row(key: str, label: str, kind: str, value: Any) -> Row:
    return {"key": key, "quantity": label, "value": value, "value_kind": kind}
