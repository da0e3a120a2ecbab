"""Train both forests on fitted blocks and score them on blocks held out."""

from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from carillon.command_line.progress import say
from carillon.processes.memory import peak_memory
from carillon.records import provenance
from forests.model import Model, save_model
from forests.training.dataset import Dataset, Samples
from forests.training.growing import KINDS, grow_trees
from forests.training.kept import Kept
from forests.training.leaf_fit import KEEP_SECONDS, add_samples, sums_of
from forests.training.leaves import Leaves, join, solve_leaves
from forests.training.options import TrainingOptions, parameters_of
from forests.training.ranks import Ranks
from forests.training.scores import held_out_scores, uniform_scores
from forests.training.spent import Spent, Stopwatch
from forests.training.structure import Tree

Grown = tuple[dict[int, Tree], Spent]
"""Trees by number, and the time that growing them took."""


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
    grown: Grown | None = None,
    kept: Kept | None = None,
    keep_seconds: float = KEEP_SECONDS,
) -> Trained | None:
    """Both steps on several ranks, each with its share of the trees and of the samples.

    Returns the trees on the first rank, None on the others; they do not depend on the number of
    ranks or threads, nor on whether the training was killed and goes on.

    Parameters
    ----------
    grown
        The trees' splits, if they were grown before.
    kept
        Where trees and sums are kept, every so many `keep_seconds`, and taken from.
    """
    trees, growing = grown or _grow(dataset, training, ranks, workers, progress, kept)
    trees = {job: trees[job] for job in training.jobs}
    state = sums_of(trees, training)
    if kept is not None:
        state = ranks.agree(lambda: kept.sums(state) if ranks.first else state)
        told = progress and ranks.first and state.samples > 0
        say(f"{kept.folder}: going on after {state.samples:,} samples", told)
    keep = None if kept is None else kept.keep_sums
    add_samples(state, dataset, training, trees, ranks, workers, progress, keep, keep_seconds)
    if not ranks.first:
        return None
    leaves = {job: solve_leaves(trees[job], state.sums[job], training.prior) for job in trees}
    whole = growing + state.spent
    facts = {
        "structure_seconds": growing.seconds,
        "leaves_seconds": state.spent.seconds,
        "training_seconds": whole.seconds,
        "processor_seconds": whole.processor_seconds,
        "peak_memory_bytes": peak_memory(),
        "training_rows": 8 * state.used,
        "rows_per_second": 8 * state.used / state.spent.seconds,
        "ranks": ranks.size,
        "workers": workers,
    }
    return Trained(trees, leaves, state.held_out, facts)


def _grow(
    dataset: Dataset,
    training: TrainingOptions,
    ranks: Ranks,
    workers: int,
    progress: bool,
    kept: Kept | None,
) -> Grown:
    trees: dict[int, Tree] = {}
    spent, clock = Spent(), Stopwatch()
    if kept is not None:
        trees, spent = ranks.agree(lambda: kept.trees(training.jobs))
        told = progress and ranks.first and len(trees) > 0
        say(f"{kept.folder}: going on with {len(trees)} of {len(training.jobs)} trees", told)
    missing = [job for job in training.jobs if job not in trees]
    for job, tree in grow_trees(dataset, training, missing, ranks, workers, progress):
        trees[job] = tree
        took = clock.read()
        spent += took
        if kept is not None and ranks.first:
            kept.keep_tree(job, tree, took)
    return trees, spent


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


def write_forests(
    out: str | Path,
    dataset: Dataset,
    training: TrainingOptions,
    ranks: Ranks,
    workers: int = 1,
    progress: bool = True,
    grown: Grown | None = None,
    keep_seconds: float = KEEP_SECONDS,
) -> Model | None:
    """Train a model and write it; what is known is kept beside the file until it is there.

    Returns the model on the first rank, None on the others. Raises UserError if another process
    trains the same file, or what is there of an earlier training has other parameters. For the rest
    see `train_trees`.
    """
    with ranks.held(out):
        kept = Kept(out, parameters_of(dataset, training))
        trained = train_trees(
            dataset, training, ranks, workers, progress, grown, kept, keep_seconds
        )
        if trained is None:
            return None
        model = model_of(dataset, training, trained)
        save_model(out, model)
        kept.remove()
    return model
