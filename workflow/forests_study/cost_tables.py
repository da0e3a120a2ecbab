"""Tables of what the forests cost: time of a block, and that over the size of forests."""

from __future__ import annotations

from typing import Any

from workflow.forests_study.results import ForestsStudy
from workflow.report.numbers import show
from workflow.report.table import Column, Table

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
    runs = next(iter(timings.values()))["runs"]
    return Table(
        "cost",
        f"Wall time of a block by the forests studied, {found['blocks']:,} random blocks at once, "
        f"{runs} warm runs; loading the forests takes {show(found['load_ms'] / 1e3, 'seconds')}. "
        f"On the trees of the last two rows scikit-learn takes {show(rival['ratio'], 'times')} the "
        f"time of coarsen, both on one core. {found['processor']}, caches {caches}.",
        [
            Column("evaluation", "Evaluation"),
            Column("median", "Median", "seconds", "s"),
            Column("least", "least", "seconds", "s"),
            Column("most", "most", "seconds", "s"),
        ],
        [
            {
                "evaluation": name,
                **{key: MICRO * timing[key] for key in ("median", "least", "most")},
            }
            for name, timing in timings.items()
        ],
    )


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
            Column("random_walk", "a walk", "seconds", "s"),
            Column("coherent", "Blocks of a mesh", "seconds", "s"),
            Column("coherent_walk", "a walk", "seconds", "s"),
        ],
        [_size_row(size) for size in study.benchmark["sizes"]],
    )


def _size_row(size: dict[str, Any]) -> dict[str, Any]:
    return {
        "bytes": MEGA * size["megabytes"],
        "trees": size["trees"],
        "depth": size["depth"],
        **{kind: MICRO * size[kind]["median"] for kind in ("random", "coherent")},
        **{f"{kind}_walk": NANO * size[f"{kind}_walk_ns"] for kind in ("random", "coherent")},
    }
