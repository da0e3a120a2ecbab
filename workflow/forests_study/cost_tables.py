"""Tables of what the forests cost: time of a block, and that over the size of forests."""

from __future__ import annotations

from typing import Any

from workflow.forests_study.results import ForestsStudy
from workflow.report.conditions import IN_COLUMNS, Repeats, conditions
from workflow.report.numbers import show
from workflow.report.table import LEAST, MOST, Column, Table

MICRO, NANO, MEGA = 1e-6, 1e-9, 1e6


def cost(study: ForestsStudy) -> Table:
    """Time of a block by each evaluation, and by scikit-learn's."""
    found = study.benchmark
    rival = found["rival"]
    timings = {
        **found["evaluation"],
        f"scikit-learn’s predict, features given: 2×{rival['trees']} trees of its own, "
        f"{rival['leaves']:,} leaves": rival["predict"],
        "coarsen, the same trees": rival["coarsen"],
    }
    caches = ", ".join(f"{name} {size}" for name, size in found["caches"].items())
    runs = _first_timing(study)["runs"]
    return Table(
        "cost",
        f"Wall time of a block by the forests studied, {found['blocks']:,} random blocks at once, "
        f"{runs} warm runs; loading the forests takes {show(found['load_ms'] / 1e3, 'seconds')}. "
        f"On the trees of the last two rows scikit-learn takes {show(rival['ratio'], 'times')} the "
        f"time of coarsen, both on one core. {found['processor']}, caches {caches}.",
        [
            Column("evaluation", "Evaluation"),
            Column("seconds", "Median", "seconds", "s"),
            Column(f"seconds{LEAST}", "min", "seconds", "s"),
            Column(f"seconds{MOST}", "max", "seconds", "s"),
        ],
        [{"evaluation": name, **_spread("seconds", timing)} for name, timing in timings.items()],
        conditions=conditions(
            {"all": study.record("benchmark")},
            study.config,
            repeats(study),
            threads="as the row says",
        ),
    )


def repeats(study: ForestsStudy) -> Repeats:
    """How often every time was measured."""
    return Repeats(f"{_first_timing(study)['runs']}, warm", IN_COLUMNS)


def _first_timing(study: ForestsStudy) -> dict[str, Any]:
    timing: dict[str, Any] = next(iter(study.benchmark["evaluation"].values()))
    return timing


def _spread(key: str, timing: dict[str, Any]) -> dict[str, float]:
    """Median, least and most of a timing [s], as values of the column `key` and its two others."""
    ends = {"": "median", LEAST: "min", MOST: "max"}
    return {f"{key}{end}": MICRO * timing[name] for end, name in ends.items()}


def sizes(study: ForestsStudy) -> Table:
    """Time of a block over the size of forests."""
    return Table(
        "sizes",
        "Wall time of a block on one core by forests of complete trees, for random blocks and for "
        "those of a mesh, whose neighbours are alike; a walk is that of one origin down one tree.",
        [
            Column("bytes", "Storage", "bytes", "B"),
            Column("trees", "Trees of each forest", "count"),
            Column("depth", "Depth", "count"),
            Column("random", "Random blocks", "seconds", "s"),
            Column(f"random{LEAST}", "min", "seconds", "s", shown=False),
            Column(f"random{MOST}", "max", "seconds", "s", shown=False),
            Column("random_walk", "a walk", "seconds", "s"),
            Column("coherent", "Blocks of a mesh", "seconds", "s"),
            Column(f"coherent{LEAST}", "min", "seconds", "s", shown=False),
            Column(f"coherent{MOST}", "max", "seconds", "s", shown=False),
            Column("coherent_walk", "a walk", "seconds", "s"),
        ],
        [_size_row(size) for size in study.benchmark["sizes"]],
        ["trees", "depth"],
        conditions({"all": study.record("benchmark")}, study.config, repeats(study), threads="1"),
    )


def _size_row(size: dict[str, Any]) -> dict[str, Any]:
    return {
        "bytes": MEGA * size["megabytes"],
        "trees": size["trees"],
        "depth": size["depth"],
        **_spread("random", size["random"]),
        **_spread("coherent", size["coherent"]),
        **{f"{kind}_walk": NANO * size[f"{kind}_walk_ns"] for kind in ("random", "coherent")},
    }
