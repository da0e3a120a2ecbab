"""How the error depends on the rows trained on, and on how the trees are made."""

import json
import logging
from collections.abc import Iterable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.parameters import OneOf, option, parameters
from carillon.parameters.quantities import LARGEST
from dataset_gen.generate import generate
from dataset_gen.settings import ShardOptions
from forests.evaluate import coarsen
from forests.layout import NODE
from forests.model import RECORD, Model, load_model
from forests.scaling import TRANSFORMS
from forests.training.dataset import (
    STUDIED,
    Dataset,
    Samples,
    dataset_of,
    joined,
    modulus_over_scale,
    rows_of,
)
from forests.training.leaves import answers_of
from forests.training.options import TrainingOptions, parameters_of
from forests.training.ranks import Ranks
from forests.training.scores import scores_of
from forests.training.structure import Tree
from forests.training.train import Trained, train_trees, write_forests
from forests.training.tree_file import difference
from studies.forests.config import VARIANTS

logger = logging.getLogger(__name__)

TEST_SAMPLES = 20_000
"""Fresh samples of each distribution that the studies are scored on."""

LEAST_RATIO = 1e-12
"""A regression of ratios may answer 0 or less, which has no logarithm: this is taken instead."""

FACTS = (
    *("structure_seconds", "leaves_seconds", "training_seconds", "processor_seconds"),
    *("peak_memory_bytes", "training_rows", "rows_per_second", "ranks", "workers"),
)
"""What forests know of their training."""

Row = dict[str, Any]


@parameters
class VariantOptions(TrainingOptions):
    """Parameters of a training that is compared, which may have transforms of no evaluator."""

    transform: Annotated[str, OneOf(*TRANSFORMS, *STUDIED)] = option("log")


def fresh_samples(dataset: Dataset) -> dict[str, Samples]:
    """Fitted samples by distribution, of a seed that the dataset does not have."""
    seed = 1 + max(part.seed for part in dataset.settings)
    drawn = dict.fromkeys(part.moduli for part in dataset.settings)
    by_distribution = {}
    for each in drawn:
        options = ShardOptions(
            TEST_SAMPLES,
            seed,
            objective=dataset.objective,
            poisson=dataset.poisson,
            distribution=each.distribution,
            low=each.low,
            high=each.high,
        )
        shard = generate(options, progress=False)
        name = f"{each.distribution} {each.low:g}..{each.high:g} GPa"
        by_distribution[name] = joined(dataset_of([shard]).read([(0, TEST_SAMPLES)]))
    return by_distribution


def _errors(trained: Trained, samples: Samples, training: TrainingOptions) -> Array:
    """Errors (n, 8) of log E, also with transforms that cannot be evaluated on a mesh."""
    errors = np.empty_like(samples.moduli)
    filled = samples.young > 0
    for kind, rows in enumerate(rows_of(samples, training.transform)):
        answers = [
            answers_of(trained.trees[job], trained.leaves[job], rows)
            for job in training.jobs
            if training.kind(job) == kind
        ]
        mean = np.mean(answers, axis=0)
        ratio, exact = (modulus_over_scale(t, training.transform) for t in (mean, rows.target))
        errors[filled == bool(kind)] = np.log(np.maximum(ratio, LEAST_RATIO)) - np.log(exact)
    return errors


def storage_of(trees: Iterable[Tree]) -> int:
    """Bytes that trees take in a model."""
    return sum(NODE.itemsize * len(tree.left) + 4 * RECORD * tree.leaves for tree in trees)


def _row(
    dataset: Dataset, training: TrainingOptions, workers: int, test: dict[str, Samples]
) -> Row:
    trained = train_trees(dataset, training, Ranks(), workers)
    assert trained is not None
    leaves = sum(tree.leaves for tree in trained.trees.values())
    scores = {
        name: scores_of(_errors(trained, samples, training), samples.young, samples.moduli)
        for name, samples in test.items()
    }
    return {
        "leaves": leaves,
        "storage_bytes": storage_of(trained.trees.values()),
        **trained.facts,
        "scores": scores,
    }


def variants(
    dataset: Dataset,
    training: TrainingOptions,
    workers: int = 1,
    names: Sequence[str] = tuple(VARIANTS),
) -> list[Row]:
    """Trainings of `VARIANTS` with the storage that `training` may take, scored on fresh samples.

    Raises UserError for a variant that is not known.
    """
    if unknown := [name for name in names if name not in VARIANTS]:
        raise UserError(f"variant {unknown[0]!r} is unknown, choose from {', '.join(VARIANTS)}")
    test = fresh_samples(dataset)
    leaves = training.max_leaves * training.trees
    rows = []
    for name in names:
        changed = VariantOptions(**{**asdict(training), **VARIANTS[name]})
        changed = replace(changed, max_leaves=max(1, leaves // changed.trees))
        logger.info(name)
        rows.append({"variant": name, **_row(dataset, changed, workers, test)})
    return rows


def learning_curve(
    dataset: Dataset,
    training: TrainingOptions,
    rows: Sequence[int],
    folder: str | Path,
    workers: int = 1,
) -> list[Row]:
    """Trainings on about so many rows of the dataset each, scored on fresh samples.

    Their forests are written to files in the folder, and taken from there where they are those of
    an earlier call. A training that was killed goes on. Raises UserError if the dataset has fewer
    rows than asked for.
    """
    available = 8 * dataset.count
    if max(rows) > available:
        raise UserError(
            f"a curve up to {max(rows):,} rows: the dataset has {available:,}, name more shards"
        )
    test = fresh_samples(dataset)
    results = []
    for count in rows:
        part = dataset.thinned(-(-count // 8))
        logger.info(f"{8 * part.count:,} rows")
        model = _trained(Path(folder, f"forests-{8 * part.count}.h5"), part, training, workers)
        results.append({"rows": 8 * part.count, **_model_row(model, test)})
    return results


def _trained(path: Path, dataset: Dataset, training: TrainingOptions, workers: int) -> Model:
    if not path.exists():
        write_forests(path, dataset, training, Ranks(), workers)
    try:
        model = load_model(path)
    except UserError as error:
        raise UserError(f"{error}; remove it to train it again") from None
    theirs = json.loads(model.provenance["parameters"])
    mine = json.loads(json.dumps(parameters_of(dataset, training)))
    if theirs != mine:
        raise UserError(f"{path}: {difference(theirs, mine)}, or choose another folder")
    return model


def _model_row(model: Model, test: dict[str, Samples]) -> Row:
    facts = {name: model.provenance[name] for name in FACTS}
    return {
        "leaves": len(model.forests.leaves),
        "storage_bytes": model.forests.nodes.nbytes + model.forests.leaves.nbytes,
        **{name: np.asarray(value).item() for name, value in facts.items()},
        "scores": {
            name: scores_of(
                np.log(coarsen(model, samples.young) / samples.moduli),
                samples.young,
                samples.moduli,
            )
            for name, samples in test.items()
        },
    }


def as_text(rows: Sequence[Row]) -> str:
    """Either study as a table."""
    head = "variant" if "variant" in rows[0] else "rows"
    tests = list(rows[0]["scores"])
    width = max(len(f"{row[head]}") for row in rows) + 2
    lines = [
        "rms error of log E on fresh solid and partly void blocks, median relative error, R^2",
        " " * (width + 25) + "".join(f"{name:<34}" for name in tests),
        f"{head:<{width}}{'leaves':>8}{'MB':>7}{'s':>8}  "
        + "".join(f"{'solid':>9}{'void':>9}{'median':>10}{'R^2':>6}" for _ in tests),
    ]
    for row in rows:
        scores = "".join(
            f"{s['rms_log_solid']:>9.4f}{s['rms_log_partly_void']:>9.4f}"
            f"{s['median_error']:>10.5f}{s['r2_log']:>6.3f}"
            for s in row["scores"].values()
        )
        lines.append(
            f"{row[head]:<{width}}{row['leaves']:>8}{row['storage_bytes'] / 1e6:>7.1f}"
            f"{row['training_seconds']:>8.1f}  {scores}"
        )
    return "\n".join(lines)


def require_counts(text: str) -> list[int]:
    """Row counts like `1e5,1e6` in ascending order.

    Raises UserError if there is anything else.
    """
    try:
        counts = sorted({int(float(part)) for part in text.split(",")})
    except (ValueError, OverflowError):
        counts = []
    if not counts or counts[0] < 1 or counts[-1] > LARGEST:
        raise UserError(f"rows {text!r}: expected counts like 1e5,1e6,1e7")
    return counts
