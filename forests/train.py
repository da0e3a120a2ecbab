"""Train both forests on fitted blocks and score them on blocks held out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon import provenance
from carillon.errors import UserError
from carillon.progress import say
from dataset_gen.element import Array
from dataset_gen.objectives import fit
from dataset_gen.sampling import pattern_classes
from dataset_gen.shards import Shard
from forests.evaluate import coarsen
from forests.leaves import Leaves, fit_leaves
from forests.model import FILLED, VOID, Model, join
from forests.scaling import FEATURES, TRANSFORMS, Features, features_of, separate, target_of
from forests.structure import GROWERS, Tree, grow


@dataclass(frozen=True)
class Training:
    """Parameters of the training.

    Attributes
    ----------
    trees, depth, min_leaf : trees a forest, their largest depth, rows of the subset a leaf needs.
    structure_rows : rows of the subset that the splits of each forest are chosen from.
    prior : see `forests.leaves.fit_leaves`.
    uniform_weight : weight of blocks of one material; they are few but fill most real objects.
    held_out : every so many-th sample is not trained on but scores the model.
    """

    trees: int = 3
    depth: int = 20
    min_leaf: int = 10
    structure_rows: int = 400_000
    prior: float = 0.005
    uniform_weight: float = 400.0
    held_out: int = 20
    transform: str = "log"
    grower: str = "random"
    seed: int = 0

    def validate(self) -> None:
        """Raise UserError when a parameter makes no sense."""
        least = {"trees": 1, "depth": 1, "min_leaf": 1, "structure_rows": 1, "held_out": 2}
        for name, bound in least.items():
            if getattr(self, name) < bound:
                raise UserError(f"{name} is {getattr(self, name)}, expected at least {bound}")
        if self.prior <= 0.0 or self.uniform_weight <= 0.0:
            raise UserError("prior and uniform weight must be positive")
        if self.seed < 0:
            raise UserError(f"seed is {self.seed}, expected 0 or more")
        for name, known in (("transform", TRANSFORMS), ("grower", tuple(GROWERS))):
            if getattr(self, name) not in known:
                raise UserError(
                    f"{name} {getattr(self, name)!r} is unknown, choose {' or '.join(known)}"
                )


def _forest(
    features: Features, target: Array, weight: Array, training: Training, workers: int
) -> list[tuple[Tree, Leaves]]:
    generator = np.random.default_rng(training.seed)
    subset = np.arange(len(target))
    if len(subset) > training.structure_rows:
        subset = np.sort(generator.choice(len(subset), training.structure_rows, replace=False))
    trees = grow(
        features[subset],
        target[subset],
        weight[subset],
        trees=training.trees,
        depth=training.depth,
        min_leaf=training.min_leaf,
        seed=training.seed,
        grower=training.grower,
        workers=workers,
    )
    return [(tree, fit_leaves(tree, features, target, weight, training.prior)) for tree in trees]


def is_uniform(young: Array) -> NDArray[np.bool_]:
    """Whether all filled cells of each block (n, 8) are equal; shape (n,)."""
    return np.asarray(young.max(axis=1) == np.where(young > 0, young, np.inf).min(axis=1))


def train(
    shards: Sequence[Shard],
    training: Training | None = None,
    workers: int = 1,
    progress: bool = True,
) -> Model:
    """Train the forests of void and of filled origins on the shards' converged samples.

    Raises
    ------
    UserError
        For impossible parameters, or too few samples of either kind.
    """
    training = training or Training()
    training.validate()
    settled = np.concatenate([shard.converged for shard in shards])
    fine = np.concatenate([shard.fine for shard in shards])[settled]
    coarse = np.concatenate([shard.coarse for shard in shards])[settled]
    number = np.concatenate([np.arange(shard.start, shard.stop) for shard in shards])[settled]
    if not settled.all():
        say(f"leaving out {np.sum(~settled)} fits that did not converge", progress)
    held = number % training.held_out == training.held_out - 1
    young, moduli = fine[~held], coarse[~held]
    scaled = separate(young, training.transform)
    features = features_of(scaled, young, training.transform)
    target = target_of(moduli, scaled.scale, training.transform)
    weight = np.where(is_uniform(young), training.uniform_weight, 1.0)
    weight = np.broadcast_to(weight[:, None], young.shape)
    forests = []
    for kind, name in ((VOID, "void"), (FILLED, "filled")):
        rows = scaled.filled == bool(kind)
        if rows.sum() < 2 * training.min_leaf:
            raise UserError(
                f"{rows.sum()} rows with a {name} origin, expected at least "
                f"{2 * training.min_leaf}; generate more samples"
            )
        say(f"training on {rows.sum()} rows with a {name} origin", progress)
        forests.append(
            _forest(
                features[rows].reshape(-1, FEATURES), target[rows], weight[rows], training, workers
            )
        )
    model = Model(
        objective=shards[0].objective,
        poisson=shards[0].poisson,
        transform=training.transform,
        forests=join(*forests),
        scores={},
        provenance=provenance.record(parameters_of(shards, training)),
    )
    scores = held_out_scores(model, fine[held], coarse[held]) | uniform_scores(model)
    return Model(**{**vars(model), "scores": {**scores, "training_samples": float(len(young))}})


def parameters_of(shards: Sequence[Shard], training: Training) -> dict[str, Any]:
    """What a training depends on, for the provenance."""
    ranges = [[shard.seed, shard.start, shard.stop] for shard in shards]
    return {**asdict(training), "objective": shards[0].objective, "samples": ranges}


def held_out_scores(model: Model, fine: Array, coarse: Array) -> dict[str, float]:
    """Errors on fits (n, 8) the training has not seen.

    R^2 of `log(E / mean(e))` and the median relative error of E, over all points, over the blocks
    without void cells, and over those with.
    """
    scores: dict[str, float] = {"held_out_samples": float(len(fine))}
    if not len(fine):
        return scores
    found = coarsen(model, fine)
    relative = np.log(coarse / fine.mean(axis=1, keepdims=True))
    error = np.log(found / coarse)
    solid = (fine > 0).all(axis=1)
    for name, rows in (("", solid | True), ("_solid", solid), ("_partly_void", ~solid)):
        if rows.sum() > 1:
            scores[f"r2_log{name}"] = 1.0 - float((error[rows] ** 2).mean() / relative[rows].var())
            scores[f"median_error{name}"] = float(np.median(np.abs(np.expm1(error[rows]))))
    return scores


def uniform_scores(model: Model) -> dict[str, float]:
    """Largest relative error of E on blocks of one material against the direct fit."""
    masks = np.concatenate(pattern_classes())
    young = (masks[:, None] >> np.arange(8) & 1).astype(float)
    error = np.abs(coarsen(model, young) / fit(model.objective, young, model.poisson).moduli - 1)
    solid = masks == 255
    return {
        "uniform_solid": float(error[solid].max()),
        "uniform_partly_void": float(error[~solid].max()),
    }
