"""Tables of the study of the forests."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from studies.base.conditions import IN_COLUMNS, ONE_COLD_RUN, Repeats, measured
from studies.base.entry import Row
from studies.base.numbers import show
from studies.forests.results import ForestsStudy
from workflow.report.blocks_tables import MEASURE as MEASURE
from workflow.report.blocks_tables import MEASURED as MEASURED
from workflow.report.blocks_tables import kind_of, on_blocks
from workflow.report.forests_tables import scores_rows

MICRO, NANO, MEGA = 1e-6, 1e-9, 1e6


def model(study: ForestsStudy) -> Iterator[Row]:
    """Size and held-out scores of the forests studied."""
    return scores_rows(study.model)


def every_block(results: Any) -> Iterator[Row]:
    """All that `forests table` found, row by row."""
    for row in on_blocks(results):
        scale = show(row["scaled_by"], "count")
        scaled = "" if row["scaled_by"] == 1.0 else f" (others times {scale})"
        yield {**row, "blocks": kind_of(row) + scaled}


def distributions(study: ForestsStudy, part: str) -> list[str]:
    """Names for people of the distributions that trainings are scored on."""
    return [name.replace("..", "…") for name in study.result(part)[0]["scores"]]


def _trainings(study: ForestsStudy, part: str) -> Iterator[Row]:
    for row in study.result(part):
        yield row | {
            f"scores{number}_{key}": value
            for number, scores in enumerate(row["scores"].values())
            for key, value in scores.items()
        }


def _measured(part: str, repeats: Any, **said: str) -> Any:
    return measured(lambda study: {"all": study.record(part)}, repeats, **said)


VARIANTS = _measured("variants", ONE_COLD_RUN)


def variants(study: ForestsStudy) -> Iterator[Row]:
    """Ways to train."""
    return _trainings(study, "variants")


CURVE = _measured("curve", ONE_COLD_RUN)


def curve(study: ForestsStudy) -> Iterator[Row]:
    """Learning curve."""
    return _trainings(study, "curve")


def runs(study: ForestsStudy) -> int:
    """Runs of which every time is the median."""
    timing: Row = next(iter(study.result("benchmark")["evaluation"].values()))
    return int(timing["runs"])


def _repeats(study: ForestsStudy) -> Repeats:
    return Repeats(f"{runs(study)}, warm", IN_COLUMNS)


def _seconds(key: str, timing: Row) -> Row:
    """Median and extremes of a timing [µs] as seconds."""
    ends = {"": "median", "_min": "min", "_max": "max"}
    return {f"{key}{end}": MICRO * timing[name] for end, name in ends.items()}


COST = _measured("benchmark", _repeats, threads="as the row says")


def cost(study: ForestsStudy) -> Iterator[Row]:
    """Time of a block by each evaluation, and by scikit-learn's."""
    benchmark = study.result("benchmark")
    rival = benchmark["rival"]
    theirs = (
        f"scikit-learn’s predict, features given: 2×{rival['trees']} trees of its own, "
        f"{rival['leaves']:,} leaves"
    )
    timings = {theirs: rival["predict"], "coarsen, the same trees": rival["coarsen"]}
    for name, timing in {**benchmark["evaluation"], **timings}.items():
        yield {"evaluation": name, **_seconds("seconds", timing)}


SIZES = _measured("benchmark", _repeats, threads="1")


def sizes(study: ForestsStudy) -> Iterator[Row]:
    """Time of a block over the size of forests."""
    for size in study.result("benchmark")["sizes"]:
        row = {"bytes": MEGA * size["megabytes"], "trees": size["trees"], "depth": size["depth"]}
        for kind in ("random", "coherent"):
            row |= _seconds(kind, size[kind]) | {f"{kind}_walk": NANO * size[f"{kind}_walk_ns"]}
        yield row
