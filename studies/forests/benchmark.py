"""What forests cost: time of a block, of loading, against scikit-learn, and over their size."""

import logging
import statistics
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from carillon.arrays import Array
from carillon.command_line.progress import track
from carillon.parameters import option, parameters
from carillon.parameters.quantities import between
from carillon.records import provenance
from forests.default import default_path
from forests.evaluate import MOST_BLOCKS, coarsen, coarsen_with_derivatives
from forests.model import FILLED, VOID, Model, load_model
from forests.scaling import FEATURES, prepare
from forests.training.leaves import join
from studies.forests.synthetic import coherent_blocks, complete_forests, random_blocks

logger = logging.getLogger(__name__)

RUNS = 7
"""Timed runs, after one that is not; medians are reported."""

THREADS = (1, 2)

CACHE_FOLDER = Path("/sys/devices/system/cpu/cpu0/cache")

SIZES = ((3, 11), (3, 13), (3, 15), (3, 17), (3, 18), (3, 19), (3, 20), (5, 20))
"""Trees of a forest and their depth: from 0.7 to 590 MB, 56 bytes a leaf."""

BYTES_OF_LEAF = 56

DEPTH = 20
"""Splits on the longest way down scikit-learn's trees, as in the paper."""

BLOCKS_PER_LEAF = 5
"""Random blocks to grow scikit-learn's trees on: ten rows a leaf where the origin is void."""


@parameters
class ForestBenchmarkOptions:
    """What is measured."""

    forest: str | None = option(
        None, "forests to measure (HDF5; default: those of the package)", metavar="FILE"
    )
    blocks: Annotated[int, between(1, MOST_BLOCKS)] = option(100_000, "evaluated in one run")
    largest: Annotated[float, between(0.001, 1e6)] = option(
        600.0, "of the largest forest [MB]", metavar="MB"
    )


def _warm_seconds(function: Callable[[], object]) -> list[float]:
    """Seconds of each of the timed runs of a function."""
    function()
    seconds = []
    for _ in range(RUNS):
        start = time.perf_counter()
        function()
        seconds.append(time.perf_counter() - start)
    return seconds


def timed(function: Callable[[], object], blocks: int) -> dict[str, float]:
    """Microseconds of a block in warm `runs` of a function that works on so many blocks."""
    seconds = _warm_seconds(function)
    low, middle, high = (min(seconds), statistics.median(seconds), max(seconds))
    micro = 1e6 / blocks
    return {"median": micro * middle, "min": micro * low, "max": micro * high, "runs": RUNS}


def caches(folder: Path = CACHE_FOLDER) -> dict[str, str]:
    """Size of each cache that the first core uses, such as `{"L1 Data": "48K"}`."""
    sizes = {}
    for entry in sorted(folder.glob("index*")):
        try:
            level, kind, size = (
                (entry / name).read_text().strip() for name in ("level", "type", "size")
            )
        except OSError:
            continue
        sizes[f"L{level}" if kind == "Unified" else f"L{level} {kind}"] = size
    return sizes


def _scikit_forests(trees: int, leaves: int) -> tuple[list[Any], Model]:
    """Forests of scikit-learn, one for void and one for filled origins, and the same as a model."""
    from sklearn.ensemble import ExtraTreesRegressor

    from forests.training.growers import flatten
    from forests.training.leaves import Leaves

    prepared = prepare(random_blocks(BLOCKS_PER_LEAF * leaves, seed=1), "log")
    generator = np.random.default_rng(0)
    estimators, parts = [], []
    for kind in (VOID, FILLED):
        features = prepared.features[prepared.filled == bool(kind)]
        target = features.mean(axis=1) + generator.uniform(-1.0, 1.0, len(features))
        forest = ExtraTreesRegressor(
            trees, max_leaf_nodes=max(2, leaves), max_depth=DEPTH, random_state=0
        )
        forest.fit(features, target)
        joined = []
        for estimator in forest.estimators_:
            tree = flatten(estimator.tree_)
            value = estimator.tree_.value[tree.left < 0, 0, 0]
            coefficients = np.zeros((tree.leaves, FEATURES + 1))
            coefficients[:, FEATURES] = value
            # Bounds as wide as values: what is constant needs none.
            bound = np.full(tree.leaves, np.abs(value).max() + 1.0)
            joined.append((tree, Leaves(coefficients, -bound, bound)))
        estimators.append(forest)
        parts.append(joined)
    return estimators, Model("none", 0.25, "log", join(*parts), {}, {})


def against_scikit_learn(young: Array, trees: int, leaves: int) -> dict[str, Any]:
    """scikit-learn's `predict` and `coarsen` on blocks (m, 8), for trees of so many leaves.

    `coarsen` computes the features as well, which `predict` is given. `ratio` says how many times
    as fast it is, `difference` the largest relative one of the moduli; `leaves` are those of all
    trees.
    """
    estimators, model = _scikit_forests(trees, leaves)
    prepared = prepare(young, model.transform)
    features = [prepared.features[prepared.filled == bool(kind)] for kind in (VOID, FILLED)]

    def predict() -> list[Array]:
        return [forest.predict(rows) for forest, rows in zip(estimators, features)]

    expected = np.empty_like(young)
    for kind, target in zip((VOID, FILLED), predict()):
        expected[prepared.filled == bool(kind)] = np.exp(target)
    expected *= prepared.scale
    theirs = timed(predict, len(young))
    ours = timed(lambda: coarsen(model, young), len(young))
    return {
        "trees": trees,
        "leaves": len(model.forests.leaves),
        "predict": theirs,
        "coarsen": ours,
        "ratio": theirs["median"] / ours["median"],
        "difference": float(np.abs(coarsen(model, young) / expected - 1.0).max()),
    }


def over_size(sizes: Sequence[tuple[int, int]], young: Array, mesh: Array) -> list[dict[str, Any]]:
    """Forests of complete trees on random blocks and on those of a mesh; ns of a walk down one."""
    rows = []
    for trees, depth in track(sizes, "forests of growing size", unit="forests"):
        model = complete_forests(trees, depth)
        random = timed(partial(coarsen, model, young), len(young))
        coherent = timed(partial(coarsen, model, mesh), len(mesh))
        row = {
            "megabytes": model.nbytes / 1e6,
            "trees": trees,
            "depth": depth,
            "random": random,
            "coherent": coherent,
            "random_walk_ns": 1e3 * random["median"] / (8 * trees),
            "coherent_walk_ns": 1e3 * coherent["median"] / (8 * trees),
        }
        rows.append(row)
    return rows


def benchmark(options: ForestBenchmarkOptions) -> dict[str, Any]:
    """Measure forests: timings by `evaluation` and threads, the `rival`, forests of all `sizes`.

    `load_ms` is the median time of loading the model, checks included; `compiled_for` the
    processor that numba compiles for.

    Raises UserError, see `forests.model.load_model`.
    """
    path = default_path() if options.forest is None else Path(options.forest)
    blocks = options.blocks
    model = load_model(path)
    young, mesh = random_blocks(blocks), coherent_blocks(blocks)
    functions = {"coarsen": coarsen, "coarsen with derivatives": coarsen_with_derivatives}
    evaluation = {
        f"{name}, {threads} thread{'s' if threads > 1 else ''}": timed(
            partial(function, model, young, threads), blocks
        )
        for name, function in functions.items()
        for threads in THREADS
    }
    evaluation["coarsen, 1 thread, blocks of a mesh"] = timed(partial(coarsen, model, mesh), blocks)
    trees, leaves = model.forests.trees, len(model.forests.leaves)
    logger.info("growing trees of scikit-learn")
    rival = against_scikit_learn(young, trees, leaves // (2 * trees))
    sizes = [
        (trees, depth)
        for trees, depth in SIZES
        if 2 * trees * BYTES_OF_LEAF * 2**depth <= 1e6 * options.largest
    ]
    return {
        "model": str(path),
        "megabytes": model.nbytes / 1e6,
        "trees": trees,
        "leaves": leaves,
        "blocks": blocks,
        "load_ms": 1e3 * statistics.median(_warm_seconds(partial(load_model, path))),
        "evaluation": evaluation,
        "rival": rival,
        "sizes": over_size(sizes, young, mesh),
        "caches": caches(),
        "processor": provenance.processor(),
        "compiled_for": provenance.compiled_for(),
    }


def as_text(result: dict[str, Any]) -> str:
    """The result in columns."""

    def line(name: str, timing: dict[str, float]) -> str:
        return f"{name:<42}{timing['median']:>8.2f}{timing['min']:>8.2f}{timing['max']:>8.2f}"

    rival = result["rival"]
    lines = [
        f"{result['processor']}, compiled for {result['compiled_for']}, caches "
        + ", ".join(f"{level} {size}" for level, size in result["caches"].items()),
        f"{result['model']}: 2 x {result['trees']} trees, {result['leaves']:,} leaves, "
        f"{result['megabytes']:.1f} MB, loaded in {result['load_ms']:.1f} ms",
        f"{result['blocks']:,} random blocks, {RUNS} warm runs",
        f"{'microseconds of a block':<42}{'median':>8}{'min':>8}{'max':>8}",
        *(line(name, timing) for name, timing in result["evaluation"].items()),
        "",
        f"trees of scikit-learn, 2 x {rival['trees']} with {rival['leaves']:,} leaves, one core",
        line("predict of scikit-learn, features given", rival["predict"]),
        line("coarsen, the same trees", rival["coarsen"]),
        f"{rival['ratio']:.1f} times as fast, moduli differ by {rival['difference']:.1e} at most",
        "",
        f"{'complete trees, one core':<28}{'random blocks':>20}{'blocks of a mesh':>20}",
        f"{'MB':>8}{'trees':>10}{'depth':>10}" + 2 * f"{'us/block':>10}{'ns/walk':>10}",
    ]
    lines += [
        f"{size['megabytes']:>8.1f}{'2 x ' + str(size['trees']):>10}{size['depth']:>10}"
        f"{size['random']['median']:>10.2f}{size['random_walk_ns']:>10.1f}"
        f"{size['coherent']['median']:>10.2f}{size['coherent_walk_ns']:>10.1f}"
        for size in result["sizes"]
    ]
    return "\n".join(lines)
