"""First step of the training (section 7.1.3): trees from a subset of the samples.

The subset is shared among the ranks: each reads or makes a part of its blocks, and sends every row
to the rank that grows the row's subtree. So a rank holds its own subtrees' rows alone.
"""

import logging
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Index
from carillon.command_line.progress import track
from carillon.errors import UserError, on_all_ranks
from forests.model import FILLED, VOID
from forests.training.blocks import WINDOW, in_order
from forests.training.dataset import Dataset, Run, rows_of
from forests.training.growers import GROWERS, LINEAR
from forests.training.linear_splits import RECORD
from forests.training.options import TrainingOptions
from forests.training.ranks import Ranks
from forests.training.routing import leaf_of, packed
from forests.training.structure import Rows, Tree, rows_together
from forests.training.subtrees import (
    Subtrees,
    Top,
    assembled,
    grow_rounds,
    grow_top,
    own_nodes,
    records_of,
)

logger = logging.getLogger(__name__)

KINDS = {VOID: "void", FILLED: "filled"}
TOP_SAMPLES = 1 << 18
"""Samples that the top of a tree is grown from: two million rows, for some hundred subtrees."""
ROWS_AT_ONCE = 1 << 20
"""Rows that are brought to their subtrees at once."""


def grow_trees(
    dataset: Dataset,
    training: TrainingOptions,
    jobs: Iterable[int],
    ranks: Ranks,
    workers: int = 1,
    progress: bool = True,
) -> Iterator[tuple[int, Tree]]:
    """Number and splits of some of the trees, the same on any number of ranks and threads.

    Every rank gets every tree. A tree depends on the dataset, the parameters and its number alone.
    Raises UserError if there are too few rows with a void or with a filled origin.
    """
    if training.grower != LINEAR:
        yield from _by_estimators(dataset, training, list(jobs), ranks, workers, progress)
        return
    subset = _Subset(dataset, training, ranks, workers, progress and ranks.first)
    for job in jobs:
        yield job, subset.grown(job)


def key_of(training: TrainingOptions, job: int) -> int:
    """Where the random numbers of a tree come from."""
    sequence = np.random.SeedSequence([training.seed, training.kind(job), job % training.trees])
    return int(sequence.generate_state(1, np.uint64)[0])


def _by_estimators(
    dataset: Dataset,
    training: TrainingOptions,
    jobs: list[int],
    ranks: Ranks,
    workers: int,
    progress: bool,
) -> Iterator[tuple[int, Tree]]:
    """Trees of scikit-learn's: each needs all rows in one process, and grows in a thread."""
    own = list(ranks.own(jobs))

    def prepared() -> tuple[Rows, Rows]:
        subset = dataset.subset(training.structure_rows // 8)
        rows = rows_of(subset, training.transform, training.uniform_weight)
        for kind in sorted({training.kind(job) for job in own}):
            shown = progress and own[0] == kind * training.trees
            require_rows(len(rows[kind]), kind, training, shown)
        return rows

    rows = ranks.agree(prepared)

    def grow(job: int) -> Tree:
        kind, seed = training.kind(job), key_of(training, job) >> 33
        return GROWERS[training.grower](rows[kind], training.limits, seed)

    with ThreadPoolExecutor(workers) as pool:
        grown = in_order(pool, grow, own, workers)
        shown = progress and ranks.first
        mine = list(zip(own, track(grown, "growing", len(own), "trees", shown), strict=True))
    yield from sorted(ranks.everywhere(mine), key=lambda pair: pair[0])


def require_rows(count: int, kind: int, training: TrainingOptions, visible: bool) -> None:
    """Check that rows of a kind suffice for trees, and warn if they do for small ones alone.

    Raises UserError if they do not.
    """
    if count < 2 * training.min_leaf:
        raise UserError(
            f"{count} rows with a {KINDS[kind]} origin, expected at least "
            f"{2 * training.min_leaf}; generate more samples"
        )
    leaves = min(training.max_leaves, 1 << min(training.depth, 62))
    if visible and count < leaves * training.min_leaf:
        logger.warning(
            f"{count:,} rows with a {KINDS[kind]} origin are too few for trees of depth "
            f"{training.depth} with {leaves:,} leaves of {training.min_leaf} rows each: they stop "
            f"at {count // training.min_leaf:,} leaves or less"
        )


@dataclass
class _Held:
    """Rows that a rank holds, in the order of the dataset."""

    records: NDArray[np.float32]
    """(n, 9), see `RECORD`."""
    marks: NDArray[np.uint16]
    """(n,) void pattern, or subtree."""

    @classmethod
    def nothing(cls) -> "_Held":
        return cls(np.empty((0, RECORD), dtype=np.float32), np.empty(0, dtype=np.uint16))

    def add(self, records: NDArray[np.float32], marks: NDArray[np.uint16]) -> None:
        """Append rows. The arrays grow where they lie, without a second copy of them."""
        before = len(self.records)
        self.records.resize((before + len(records), RECORD), refcheck=False)
        self.marks.resize(before + len(records), refcheck=False)
        self.records[before:], self.marks[before:] = records, marks

    def divided(self, owners: Index, ranks: int) -> list["_Held"]:
        """The rows of each rank, `owners` being the ranks of the subtrees."""
        owner = owners[self.marks]
        order = np.argsort(owner, kind="stable")
        ends = np.cumsum(np.bincount(owner, minlength=ranks))[:-1]
        return [_Held(self.records[part], self.marks[part]) for part in np.split(order, ends)]


class _Subset:
    """The samples that splits are chosen from, shared among the ranks."""

    def __init__(
        self,
        dataset: Dataset,
        training: TrainingOptions,
        ranks: Ranks,
        workers: int,
        visible: bool,
    ) -> None:
        self._dataset, self._training, self._ranks = dataset, training, ranks
        self._workers, self._visible = workers, visible
        self._kind = -1
        self._sample: Rows | None = None
        self._held: _Held | None = None

    def grown(self, job: int) -> Tree:
        """Grow a tree together with the other ranks."""
        training, ranks = self._training, self._ranks
        if training.kind(job) != self._kind:
            self._kind, self._held = training.kind(job), None
            self._sample = self._top_sample()
        top = None
        if self._sample is not None:
            top = grow_top(
                self._sample, training.limits, key_of(training, job), self._expected_rows
            )
        top = ranks.from_one(top)
        assert top is not None
        owners = owners_of(top, ranks.size)
        held = self._routed(top, owners)
        own = Subtrees(top, held.records, held.marks, training.limits, self._workers)
        rounds = grow_rounds(top, own, training.limits, ranks)
        label = f"growing tree {job + 1} of {len(training.jobs)}"
        for _ in track(_steps(rounds), label, None, "leaves", self._visible, int):
            pass
        parts = ranks.in_order([own_nodes(own, np.flatnonzero(owners == ranks.rank))])
        tree = None
        if ranks.first:
            nodes = {number: each for part in parts for number, each in part.items()}
            tree = assembled(top, [nodes[n] for n in range(len(nodes))], training.limits)
        tree = ranks.from_one(tree)
        assert tree is not None
        return tree

    def _rows(self, runs: list[Run]) -> Rows:
        """Rows of this kind in a block."""
        training = self._training
        samples = self._dataset.learned(runs)
        return rows_of(samples, training.transform, training.uniform_weight)[self._kind]

    def _blocks(self, samples: int) -> Iterator[Rows]:
        """This rank's blocks of samples spread over the dataset: every so-manieth."""
        own = self._ranks.own(self._dataset.spread(samples))
        with ThreadPoolExecutor(self._workers) as pool:
            yield from in_order(pool, self._rows, own, WINDOW * self._workers)

    def _top_sample(self) -> Rows | None:
        """Rows that the tops of this kind's trees are grown from, on the first rank."""
        wanted = max(1, self._training.structure_rows // 8)
        samples = min(wanted, TOP_SAMPLES)
        numbered = [
            (self._ranks.rank + n * self._ranks.size, rows)
            for n, rows in enumerate(self._blocks(samples))
        ]
        count = self._ranks.total(sum(len(rows) for _, rows in numbered))
        available = self._dataset.count
        share = min(samples, available) / min(wanted, available)
        self._expected_rows = round(count / share)
        with on_all_ranks():
            require_rows(self._expected_rows, self._kind, self._training, self._visible)
        blocks = sorted(self._ranks.in_order(numbered), key=lambda item: item[0])
        return rows_together([rows for _, rows in blocks]) if self._ranks.first else None

    def _routed(self, top: Top, owners: Index) -> _Held:
        """The rows of this rank's subtrees, with the number of their subtree."""
        if self._ranks.size > 1:
            return self._exchanged(top, owners)
        if self._held is None:
            self._held = _Held.nothing()
            for rows in self._tracked(self._blocks(self._training.structure_rows // 8)):
                self._held.add(records_of(rows), rows.pattern.astype(np.uint16))
        numbers = np.empty(len(self._held.marks), dtype=np.uint16)
        walked = packed(top.tree)
        for first in range(0, len(numbers), ROWS_AT_ONCE):
            part = slice(first, first + ROWS_AT_ONCE)
            numbers[part] = leaf_of(walked, self._held.records[part], self._held.marks[part])
        return _Held(self._held.records, numbers)

    def _exchanged(self, top: Top, owners: Index) -> _Held:
        """Rows that all ranks have sent to this one, in the order of the dataset."""
        held, walked = _Held.nothing(), packed(top.tree)
        samples = self._training.structure_rows // 8
        turns = -(-len(self._dataset.spread(samples)) // self._ranks.size)
        blocks = self._tracked(self._blocks(samples))
        for _ in range(turns):
            rows = next(blocks, None)
            own = _Held.nothing()
            if rows is not None:
                numbers = leaf_of(walked, rows.features, rows.pattern)
                own.add(records_of(rows), numbers.astype(np.uint16))
            for received in self._ranks.exchanged(own.divided(owners, self._ranks.size)):
                held.add(received.records, received.marks)
        return held

    def _tracked(self, blocks: Iterator[Rows]) -> Iterator[Rows]:
        label = f"rows with a {KINDS[self._kind]} origin"
        return track(blocks, label, None, "rows", self._visible, len)


def owners_of(top: Top, ranks: int) -> Index:
    """Rank of each subtree: the largest first, each to the rank that has fewest rows."""
    sizes = (top.nodes["stop"] - top.nodes["start"])[top.leaves]
    owners, load = np.zeros(len(sizes), dtype=np.int64), np.zeros(ranks, dtype=np.int64)
    for number in np.argsort(-sizes, kind="stable"):
        owners[number] = load.argmin()
        load[owners[number]] += sizes[number] + 1
    return owners


def _steps(totals: Iterator[int]) -> Iterator[int]:
    before = 0
    for total in totals:
        yield total - before
        before = total
