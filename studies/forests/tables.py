"""Tables of the study of the forests."""

from collections.abc import Iterator
from typing import Any

from studies.base.conditions import IN_COLUMNS, ONE_COLD_RUN, Repeats, measured
from studies.base.numbers import show
from studies.base.table import Column, Row, each, hidden, spread, table
from studies.forests.results import ForestsStudy
from workflow.report.blocks_tables import MEASURE, MEASURED, kind_of, on_blocks
from workflow.report.blocks_tables import blocks as blocks
from workflow.report.forests_tables import scores_rows

MICRO, NANO, MEGA = 1e-6, 1e-9, 1e6


@table(
    hidden("key", "Key"),
    Column("quantity", "Quantity"),
    Column("value", "Value"),
    hidden("value_kind", "Its kind"),
)
def model(study: ForestsStudy) -> Iterator[Row]:
    """The forests studied ({model[path]}): objective {model[objective]}, Poisson’s ratio
    {model[poisson]:g}. Held-out blocks were not used in training."""
    return scores_rows(study.model)


@table(
    Column("blocks", "Blocks"),
    Column("method", "Coarsening"),
    Column("mean_error", "Nodal, mean", "small"),
    Column("median_error", "median", "small"),
    Column("mean_error_inertial", "Inertia, mean", "small"),
    Column("median_error_inertial", "median", "small"),
    Column("mean_error_corner", "Corner, mean", "small"),
    Column("median_error_corner", "median", "small"),
    Column("mean_squared_m2", "Nodal, absolute [m²]", "small", "m^2"),
    Column("seconds_per_block", "Cost per block", "seconds"),
    Column("seconds_per_block_min", "min", "seconds"),
    Column("seconds_per_block_max", "max", "seconds"),
    Column("storage_bytes", "Storage", "bytes"),
    Column("training_seconds", "Made in", "seconds"),
    keys="blocks method",
    conditions=MEASURED,
    measure=MEASURE,
)
def every_block(results: Any) -> Iterator[Row]:
    """Every coarsening on {on_blocks[result][0][blocks]:count} random blocks of each kind, on one
    core; costs are medians. Errors: {measure} Corner: forces on the corners only. Databases beyond
    the range that they were made for take their stiffest material."""
    for row in on_blocks(results):
        scale = show(row["scaled_by"], "count")
        scaled = "" if row["scaled_by"] == 1.0 else f" (others times {scale})"
        yield {**row, "blocks": kind_of(row) + scaled}


def _scores(study: ForestsStudy, part: str) -> list[Column]:
    names = study.result(part)[0]["scores"]
    return each(
        {f"scores{number}": name.replace("..", "…") for number, name in enumerate(names)},
        Column("{name}_rms_log_solid", "{label}: rms of log E, solid", "fraction"),
        Column("{name}_rms_log_partly_void", "rms of log E, partly void", "fraction"),
        Column("{name}_median_error", "median error of E", "percent"),
        Column("{name}_r2_log", "R² of log E", "score"),
    )


def _trainings(study: ForestsStudy, part: str) -> Iterator[Row]:
    for row in study.result(part):
        yield row | {
            f"scores{number}_{key}": value
            for number, scores in enumerate(row["scores"].values())
            for key, value in scores.items()
        }


def _measured(part: str, repeats: Any, **said: str) -> Any:
    return measured(lambda study: {"all": study.record(part)}, repeats, **said)


@table(
    Column("variant", "Training"),
    Column("training_rows", "Rows trained on", "count"),
    Column("leaves", "Leaves", "count"),
    Column("storage_bytes", "Storage", "bytes"),
    Column("training_seconds", "Training", "seconds"),
    lambda study: _scores(study, "variants"),
    conditions=_measured("variants", ONE_COLD_RUN),
)
def variants(study: ForestsStudy) -> Iterator[Row]:
    """Ways to train, on the same rows and with the same storage, so little that all fill it; “the
    same” refers to the training of the default forests. Scores are on fresh blocks that no training
    has seen, by distribution of their moduli: rms of the error of log E over solid and over partly
    void blocks, median relative error of a modulus E, and R² of log E; all against the fit that is
    learned."""
    return _trainings(study, "variants")


@table(
    Column("rows", "Rows", "count"),
    hidden("training_rows", "Rows trained on", "count"),
    Column("leaves", "Leaves", "count"),
    Column("storage_bytes", "Storage", "bytes"),
    Column("training_seconds", "Training", "seconds"),
    lambda study: _scores(study, "curve"),
    conditions=_measured("curve", ONE_COLD_RUN),
)
def curve(study: ForestsStudy) -> Iterator[Row]:
    """The same training on more and more rows, eight to a block. Scores are on fresh blocks that no
    training has seen, by distribution of their moduli: rms of the error of log E over solid and
    over partly void blocks, median relative error of a modulus E, and R² of log E; all against the
    fit that is learned."""
    return _trainings(study, "curve")


def runs(study: ForestsStudy) -> int:
    """Runs of which every time is the median."""
    return int(next(iter(study.benchmark["evaluation"].values()))["runs"])


def _repeats(study: ForestsStudy) -> Repeats:
    return Repeats(f"{runs(study)}, warm", IN_COLUMNS)


def _seconds(key: str, timing: Row) -> Row:
    """Median and extremes of a timing [µs] as seconds."""
    ends = {"": "median", "_min": "min", "_max": "max"}
    return {f"{key}{end}": MICRO * timing[name] for end, name in ends.items()}


@table(
    Column("evaluation", "Evaluation"),
    spread("seconds", "Median", "seconds"),
    conditions=_measured("benchmark", _repeats, threads="as the row says"),
    runs=runs,
    loading=lambda study: study.benchmark["load_ms"] / 1e3,
    caches=lambda study: ", ".join(f"{k} {size}" for k, size in study.benchmark["caches"].items()),
)
def cost(study: ForestsStudy) -> Iterator[Row]:
    """Wall time of a block by the forests studied, {benchmark[blocks]:count} random blocks at once,
    {runs} warm runs; loading the forests takes {loading:seconds}. On the trees of the last two rows
    scikit-learn takes {benchmark[rival][ratio]:times} the time of coarsen, both on one core.
    {benchmark[processor]}, caches {caches}."""
    benchmark = study.benchmark
    rival = benchmark["rival"]
    theirs = (
        f"scikit-learn’s predict, features given: 2×{rival['trees']} trees of its own, "
        f"{rival['leaves']:,} leaves"
    )
    timings = {theirs: rival["predict"], "coarsen, the same trees": rival["coarsen"]}
    for name, timing in {**benchmark["evaluation"], **timings}.items():
        yield {"evaluation": name, **_seconds("seconds", timing)}


@table(
    Column("bytes", "Storage", "bytes"),
    Column("trees", "Trees of each forest", "count"),
    Column("depth", "Depth", "count"),
    spread("random", "Random blocks", "seconds", shown=False),
    Column("random_walk", "a walk", "seconds"),
    spread("coherent", "Blocks of a mesh", "seconds", shown=False),
    Column("coherent_walk", "a walk", "seconds"),
    keys="trees depth",
    conditions=_measured("benchmark", _repeats, threads="1"),
)
def sizes(study: ForestsStudy) -> Iterator[Row]:
    """Wall time of a block on one core by forests of complete trees, for random blocks and for
    those of a mesh, whose neighbours are alike; a walk is that of one origin down one tree."""
    for size in study.benchmark["sizes"]:
        row = {"bytes": MEGA * size["megabytes"], "trees": size["trees"], "depth": size["depth"]}
        for kind in ("random", "coherent"):
            row |= _seconds(kind, size[kind]) | {f"{kind}_walk": NANO * size[f"{kind}_walk_ns"]}
        yield row
