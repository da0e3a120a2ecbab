"""Second step of the training (section 7.1.3): sums over all samples, block by block.

Blocks are shared among ranks and threads. They may be added in any order, since the sums are exact;
after every slice of blocks all ranks have added the same share, and what is known can be kept.
"""

import logging
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from threading import Lock

import numpy as np

from carillon.command_line.progress import track
from carillon.errors import UserError
from forests.scaling import is_logarithmic
from forests.training.blocks import WINDOW, in_order
from forests.training.dataset import STUDIED, Dataset, Run, Samples, joined, rows_of
from forests.training.exact_sums import Sums, bits_of
from forests.training.options import TrainingOptions
from forests.training.ranks import Ranks
from forests.training.routing import leaf_of, packed
from forests.training.spent import Spent, Stopwatch
from forests.training.structure import Tree

logger = logging.getLogger(__name__)

SLICE_SECONDS = 10.0
"""Time between two points at which all ranks have done the same share, about."""
KEEP_SECONDS = 300.0
"""Time between two times that sums are kept."""
COSTLY = 20.0
"""Times as long as keeping them took, at least."""


@dataclass
class LeafSums:
    """Sums of all trees' leaves over the first blocks of a dataset, and samples held out."""

    sums: dict[int, Sums]
    """By tree number."""
    held_out: Samples = field(default_factory=lambda: joined([]))
    """Samples that were not trained on, in order."""
    samples: int = 0
    """Samples of the blocks done."""
    used: int = 0
    """Samples trained on."""
    spent: Spent = Spent()
    """Time that it took."""


Keep = Callable[[LeafSums], None]


def sums_of(trees: dict[int, Tree], training: TrainingOptions) -> LeafSums:
    """Sums over no samples."""
    logarithmic = training.transform == STUDIED[1] or (
        training.transform not in STUDIED and is_logarithmic(training.transform)
    )
    bits = bits_of(logarithmic, training.uniform_weight)
    return LeafSums({job: Sums.nothing(tree.leaves, bits) for job, tree in trees.items()})


def add_samples(
    state: LeafSums,
    dataset: Dataset,
    training: TrainingOptions,
    trees: dict[int, Tree],
    ranks: Ranks,
    workers: int = 1,
    progress: bool = True,
    keep: Keep | None = None,
    keep_seconds: float = KEEP_SECONDS,
) -> None:
    """Add all samples that a state lacks, on all ranks; the state of the first one is the result.

    Parameters
    ----------
    state
        What an earlier run knew, on the first rank; nothing on the others.
    keep
        Called on the first rank with what is known, about every `keep_seconds`.
    """
    clock = Stopwatch()
    done = ranks.from_one(state.samples)
    adding = _Adding(state, dataset, training, trees)
    blocks = dataset.blocks(done)
    least = workers * ranks.size
    kept, cost = time.monotonic(), 0.0

    def added() -> Iterator[int]:
        nonlocal kept, cost
        with ThreadPoolExecutor(workers) as pool:
            first, length = 0, least
            while first < len(blocks):
                begun = time.monotonic()
                chosen = map(dataset.run_of, ranks.own(blocks[first : first + length]))
                held_out = [state.held_out]
                for block, samples in in_order(pool, adding.block, chosen, WINDOW * workers):
                    held_out.append(block)
                    yield samples * ranks.size
                state.held_out = joined(held_out)
                first += length
                state.samples = dataset.run_of(blocks[:first][-1])[1]
                now = time.monotonic()
                due = now - kept > max(keep_seconds, COSTLY * cost)
                due, length = ranks.from_one((due, _next_length(length, now - begun, least)))
                if keep is None or not due:
                    continue
                _gather(state, ranks)
                state.spent += clock.read()
                if ranks.first:
                    start = time.monotonic()
                    try:
                        keep(state)
                    except UserError as error:
                        logger.warning(f"{error}; the training goes on, with nothing kept of it")
                    kept = time.monotonic()
                    cost = kept - start

    shown = progress and ranks.first
    for _ in track(added(), "fitting leaves", dataset.count, "samples", shown, int, done):
        pass
    _gather(state, ranks)
    state.samples = dataset.count
    state.spent += clock.read()


def _next_length(length: int, took: float, least: int) -> int:
    """Blocks of the next slice, after one that took so many seconds."""
    if took < SLICE_SECONDS / 2:
        return 2 * length
    return max(least, length // 2) if took > 2 * SLICE_SECONDS else length


class _Adding:
    """Adds blocks of samples to sums, several at a time."""

    def __init__(
        self,
        state: LeafSums,
        dataset: Dataset,
        training: TrainingOptions,
        trees: dict[int, Tree],
    ) -> None:
        self._state, self._dataset, self._training = state, dataset, training
        self._trees = {job: packed(tree) for job, tree in trees.items()}
        self._locks = {job: Lock() for job in trees}
        self._counting = Lock()

    def block(self, run: Run) -> tuple[Samples, int]:
        """Add the samples of a block: what of it is not trained on, and its length."""
        samples = joined(self._dataset.read([run]))
        out = self._dataset.is_held_out(samples.position)
        learned = samples.where(~out)
        rows = rows_of(learned, self._training.transform, self._training.uniform_weight)
        # Threads begin with different trees, so that none waits for the others' sums.
        jobs = list(self._trees)
        turn = run[0] // (run[1] - run[0]) % len(jobs)
        for job in jobs[turn:] + jobs[:turn]:
            own = rows[self._training.kind(job)]
            leaf_numbers = leaf_of(self._trees[job], own.features, own.pattern)
            with self._locks[job]:
                sums = self._state.sums[job]
                sums.add(leaf_numbers, own.features, own.target, own.weight)
        with self._counting:
            self._state.used += len(learned.young)
        return samples.where(out), run[1] - run[0]


def _gather(state: LeafSums, ranks: Ranks) -> None:
    """Bring what all ranks know to the first one; the others know nothing then."""
    for sums in state.sums.values():
        ranks.add_up(sums)
    parts = ranks.in_order([(state.held_out, state.used)])
    state.held_out, state.used = joined([]), 0
    if ranks.first:
        held_out = joined(part for part, _ in parts)
        order = np.argsort(held_out.position)
        state.held_out = held_out.where(order)
        state.used = sum(used for _, used in parts)
