"""How well forests reproduce the fits they were trained on."""

import numpy as np

from carillon.arrays import Array
from carillon.fem.block import ALL_FILLED
from dataset_gen.objectives import fit
from dataset_gen.sampling import pattern_classes
from forests.evaluate import coarsen
from forests.model import Model


def scores_of(error: Array, fine: Array, coarse: Array) -> dict[str, float]:
    """Scores of errors (n, 8) of log E against the fits (n, 8) of blocks (n, 8).

    Over all points, over the blocks without void cells, and over those with: R^2 of
    `log(E / mean(e))`, root mean square of the error of log E, median relative error of E. Kinds of
    less than two blocks have none.
    """
    scores = {}
    relative = np.log(coarse / fine.mean(axis=1, keepdims=True))
    solid = (fine > 0).all(axis=1)
    for name, rows in (("", solid | True), ("_solid", solid), ("_partly_void", ~solid)):
        if rows.sum() > 1:
            mean_square = float((error[rows] ** 2).mean())
            scores[f"r2_log{name}"] = 1.0 - mean_square / float(relative[rows].var())
            scores[f"rms_log{name}"] = mean_square**0.5
            scores[f"median_error{name}"] = float(np.median(np.abs(np.expm1(error[rows]))))
    return scores


def held_out_scores(model: Model, fine: Array, coarse: Array) -> dict[str, float]:
    """Number of fits (n, 8) that the training has not seen, and the model's scores on them."""
    scores = {"held_out_samples": float(len(fine))}
    if not len(fine):
        return scores
    return scores | scores_of(np.log(coarsen(model, fine) / coarse), fine, coarse)


def uniform_scores(model: Model) -> dict[str, float]:
    """Largest relative error of E on blocks of one material against the direct fit."""
    masks = np.concatenate(pattern_classes())
    young = (masks[:, None] >> np.arange(8) & 1).astype(float)
    error = np.abs(coarsen(model, young) / fit(model.objective, young, model.poisson).moduli - 1)
    solid = masks == ALL_FILLED
    return {
        "uniform_solid": float(error[solid].max()),
        "uniform_partly_void": float(error[~solid].max()),
    }
