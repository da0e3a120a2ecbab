"""Train both forests on fitted blocks and score them on blocks held out."""

import logging
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from typing import Annotated, Any, NamedTuple, TypeVar

import numpy as np
from joblib import Parallel, delayed

from carillon.command_line.progress import track
from carillon.errors import UserError
from carillon.parameters import OneOf, option, parameters
from carillon.parameters.quantities import Count, Number, between
from carillon.records import provenance
from forests.layout import MOST_LEAVES
from forests.model import FILLED, VOID, Model
from forests.scaling import TRANSFORMS
from forests.training.dataset import Dataset, Samples, joined, rows_of
from forests.training.leaves import Leaves, Sums, add_rows, join, solve_leaves
from forests.training.ranks import Ranks
from forests.training.scores import held_out_scores, uniform_scores
from forests.training.structure import GROWERS, Rows, Tree, TreeLimits

logger = logging.getLogger(__name__)

T = TypeVar("T")

KINDS = {VOID: "void", FILLED: "filled"}


@parameters
class TrainingOptions:
    """Parameters of the training."""

    trees: Annotated[int, between(1, 1000)] = option(3, "of each of the two forests")
    depth: Annotated[int, between(1, 1000)] = option(20, "of a tree, at most")
    max_leaves: Annotated[int, between(1, MOST_LEAVES)] = option(
        30_000, "of a tree, at most; 56 bytes each"
    )
    min_leaf: Count = option(30, "rows of the subset that a leaf needs")
    structure_rows: Count = option(5_000_000, "rows of the subset that splits are chosen from")
    prior: Annotated[float, between(1e-9, 1e9)] = option(
        0.5, "rows that the surroundings of a leaf count for in it"
    )
    uniform_weight: Annotated[float, between(1e-9, 1e9)] = option(
        400.0, "weight of blocks of one material; they are few but fill most real objects"
    )
    transform: Annotated[str, OneOf(*TRANSFORMS)] = option("log", "of the features and the target")
    grower: Annotated[str, OneOf(*GROWERS)] = option("linear", "how splits are chosen")
    seed: Number = option(0, "of the splits")

    @property
    def limits(self) -> TreeLimits:
        """What a tree may grow to."""
        return TreeLimits(self.max_leaves, self.min_leaf, self.depth)

    @property
    def jobs(self) -> range:
        """Numbers of all trees: those of the forest of void origins, then the others."""
        return range(2 * self.trees)

    def kind(self, job: int) -> int:
        """Forest that a tree belongs to."""
        return job // self.trees


def grow_trees(
    dataset: Dataset,
    training: TrainingOptions,
    jobs: range,
    workers: int = 1,
    progress: bool = True,
) -> dict[int, Tree]:
    """First step: the splits of some of the trees, one tree a thread.

    A tree depends on the dataset, the parameters and its number alone. Raises UserError if there
    are too few rows with a void or with a filled origin.
    """
    if not jobs:
        return {}
    subset = dataset.subset(training.structure_rows // 8)
    rows = rows_of(subset, training.transform, training.uniform_weight)
    for kind in sorted({training.kind(job) for job in jobs}):
        _require_rows(rows[kind], kind, training, progress and jobs[0] == kind * training.trees)

    def grow(job: int) -> Tree:
        kind = training.kind(job)
        sequence = np.random.SeedSequence([training.seed, kind, job % training.trees])
        seed = int(sequence.generate_state(1)[0] >> 1)
        return GROWERS[training.grower](rows[kind], training.limits, seed)

    # Started one by one, so that the progress is that of trees finished.
    grown = Parallel(n_jobs=workers, prefer="threads", return_as="generator")(
        delayed(grow)(job) for job in jobs
    )
    trees = track(grown, "growing", total=len(jobs), unit="trees", visible=progress)
    return dict(zip(jobs, trees, strict=True))


def _require_rows(rows: Rows, kind: int, training: TrainingOptions, tell: bool) -> None:
    if len(rows) < 2 * training.min_leaf:
        raise UserError(
            f"{len(rows)} rows with a {KINDS[kind]} origin, expected at least "
            f"{2 * training.min_leaf}; generate more samples"
        )
    leaves = min(training.max_leaves, 1 << min(training.depth, 62))
    if tell and len(rows) < leaves * training.min_leaf:
        logger.warning(
            f"{len(rows):,} rows with a {KINDS[kind]} origin are too few for trees of depth "
            f"{training.depth} with {leaves:,} leaves of {training.min_leaf} rows each: they stop "
            f"at {len(rows) // training.min_leaf:,} leaves or less"
        )


def fit_leaves(
    dataset: Dataset,
    training: TrainingOptions,
    trees: dict[int, Tree],
    ranks: Ranks,
    workers: int = 1,
    progress: bool = True,
) -> tuple[dict[int, Leaves], Samples, int]:
    """Second step: the leaves' functions from all samples, read once and in pieces.

    Returns
    -------
    leaves : dict
        Leaves of every tree, on the first rank.
    held_out : Samples
        Samples that were not trained on, on the first rank.
    used : int
        How many were trained on, on the first rank.
    """
    sums = {job: Sums.nothing(tree.leaves) for job, tree in trees.items()}
    held: list[Samples] = []
    begin, end = ranks.own_samples(dataset.count)

    def prepared() -> Iterator[tuple[tuple[Rows, Rows], int]]:
        for piece in dataset.read(begin, end):
            out = dataset.is_held_out(piece.position)
            held.append(piece.where(out))
            learned = piece.where(~out)
            yield rows_of(learned, training.transform, training.uniform_weight), len(piece.young)

    used = 0
    label = "fitting leaves" if ranks.size == 1 else f"fitting leaves, first of {ranks.size} ranks"
    with ThreadPoolExecutor(workers) as pool:
        for rows, _ in track(
            _ahead(pool, prepared()),
            label,
            total=end - begin,
            unit="samples",
            visible=progress and ranks.first,
            weight=lambda item: item[1],
        ):
            jobs = [
                pool.submit(add_rows, sums[job], tree, rows[training.kind(job)])
                for job, tree in trees.items()
            ]
            for running in jobs:
                running.result()
            used += (len(rows[VOID]) + len(rows[FILLED])) // 8
    for part in sums.values():
        ranks.add_up(part)
    everything = ranks.in_order([(held, used)])
    if not ranks.first:
        return {}, joined(held), used
    solved = {job: solve_leaves(trees[job], sums[job], training.prior) for job in trees}
    left_out = joined(piece for pieces, _ in everything for piece in pieces)
    return solved, left_out, sum(count for _, count in everything)


def _ahead(pool: ThreadPoolExecutor, items: Iterator[T]) -> Iterator[T]:
    following = pool.submit(next, items, None)
    while (item := following.result()) is not None:
        following = pool.submit(next, items, None)
        yield item


class Trained(NamedTuple):
    """Both steps' result."""

    trees: dict[int, Tree]
    leaves: dict[int, Leaves]
    """By tree number."""
    held_out: Samples
    """Samples that were not trained on."""
    facts: dict[str, Any]
    """Seconds, rows, ranks and workers by name."""


def train_trees(
    dataset: Dataset,
    training: TrainingOptions,
    ranks: Ranks,
    workers: int = 1,
    progress: bool = True,
    grown: tuple[dict[int, Tree], float] | None = None,
) -> Trained | None:
    """Both steps on several ranks, each with its share of the trees and of the samples.

    `grown` are the splits by tree number from `grow_trees` and the seconds they took, if they are
    there. Returns the trees on the first rank, None on the others. They depend on the number of
    ranks to rounding.
    """
    begin = time.perf_counter()
    if grown is None:
        shown = progress and ranks.first
        mine = grow_trees(dataset, training, ranks.own_jobs(training.jobs), workers, shown)
        grown = ranks.together(mine), time.perf_counter() - begin
    splits, structure_seconds = grown
    trees = {job: splits[job] for job in training.jobs}
    begin = time.perf_counter()
    leaves, held, used = fit_leaves(dataset, training, trees, ranks, workers, progress)
    if not ranks.first:
        return None
    leaves_seconds = time.perf_counter() - begin
    facts = {
        "structure_seconds": structure_seconds,
        "leaves_seconds": leaves_seconds,
        "training_seconds": structure_seconds + leaves_seconds,
        "training_rows": 8 * used,
        "rows_per_second": 8 * used / leaves_seconds,
        "ranks": ranks.size,
        "workers": workers,
    }
    return Trained(trees, leaves, held, facts)


def model_of(dataset: Dataset, training: TrainingOptions, trained: Trained) -> Model:
    """The model that evaluates trained trees, with its scores and its provenance."""
    void, filled = (
        [(trained.trees[j], trained.leaves[j]) for j in training.jobs if training.kind(j) == kind]
        for kind in KINDS
    )
    model = Model(
        objective=dataset.objective,
        poisson=dataset.poisson,
        transform=training.transform,
        forests=join(void, filled),
        scores={},
        provenance=provenance.record(parameters_of(dataset, training)) | trained.facts,
    )
    held = trained.held_out
    scores = held_out_scores(model, held.young, held.moduli) | uniform_scores(model)
    scores |= {
        "training_samples": trained.facts["training_rows"] / 8,
        "leaves": float(sum(tree.leaves for tree in trained.trees.values())),
        "depth": float(max(tree.depth for tree in trained.trees.values())),
    }
    return replace(model, scores=scores)


def parameters_of(dataset: Dataset, training: TrainingOptions) -> dict[str, Any]:
    """What a training depends on, for the provenance."""
    ranges = [
        [part.seed, part.distribution, part.low, part.high, part.start, part.stop]
        for part in dataset.settings
    ]
    return {**asdict(training), "objective": dataset.objective, "samples": ranges}
