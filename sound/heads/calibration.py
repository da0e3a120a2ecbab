"""Finds the blend of heads that a listener prefers, from comparisons of pairs.

Pairs are drawn by CMA-ES in generations of eight points.  A Gaussian process of the cost, fitted to
all answers, ranks the points of a generation, and its gradients lead the mean of the next one, as
in hybrid evolution (Chen, Xudiera and Montgomery 2012).  The relative scores and their offsets are
those of Koyama, Sakamoto and Igarashi (CHI 2014).
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.command_line.counts import counted
from carillon.errors import UserError
from carillon.files.atomic import atomic_path
from carillon.files.paths import require_file
from sound.heads.head_space import HeadSpace
from sound.heads.preference import OFFSETS, Preference, RatedPair

GENERATION = 8
"""Points of a generation, which are compared in pairs."""
FARTHEST = 3.0
"""Greatest coordinate of a point that is played, in standard deviations of the heads."""
STEP = 2.0
"""Greatest move of the mean along gradients, in step sizes of the evolution strategy."""
LEAST_STEP = 0.8
"""Least step size of the evolution strategy, in standard deviations of the heads: blends that are
nearer to each other sound so alike that answers tell little."""
KIND, VERSION = "calibration of a head", 1
EXPECTED = "a calibration (JSON) that carillon wrote"
LONGEST_FILE = 1 << 24
"""Most bytes of a file of a calibration."""


class HeadCalibration:
    """Asks for comparisons of points in a space of heads, and is told the answers.

    The same seed and answers give the same pairs, also after the calibration was saved and loaded.

    Parameters
    ----------
    scales : (K,) [dB]
        Standard deviations of the heads along each coordinate.
    titles : S texts
        What the heads are called, by which a saved calibration knows them.
    seed : int
        Seed of the pairs.
    """

    def __init__(self, scales: Array, titles: Sequence[str], seed: int) -> None:
        import cma

        self.scales, self.titles, self.seed = scales, list(titles), seed
        self.comparisons: list[RatedPair] = []
        self.best: Array = np.zeros(len(scales))
        random = np.random.default_rng(seed)
        options = {
            "popsize": GENERATION,
            "verbose": -9,
            "seed": np.nan,  # its numbers are drawn here
            "randn": lambda *shape: random.standard_normal(shape),
        }
        self._strategy = cma.CMAEvolutionStrategy(self.best, 1.0, options)
        self._generation = self._drawn()

    @property
    def count(self) -> int:
        """Number of comparisons that were made."""
        return len(self.comparisons)

    @property
    def comment(self) -> str:
        """What a file of the blend that is preferred says of it."""
        return f"preferred after {counted(self.count, 'comparison')}"

    def next_pair(self) -> tuple[Array, Array]:
        """Two points (K,) to compare next: the same ones until they are answered."""
        number = 2 * (self.count % (GENERATION // 2))
        return self._generation[number], self._generation[number + 1]

    def answer(self, score: int) -> None:
        """Take the score of the pair, from 1 (the first is definitely better) to 5 (the second is).

        Raises UserError for any other score.
        """
        if score not in OFFSETS:
            raise UserError(f"a score of {score}, expected 1 to 5")
        self._take(RatedPair(*self.next_pair(), score))

    def as_json(self) -> str:
        """What is needed to go on, as the text of a file."""
        content = {
            "kind": KIND,
            "version": VERSION,
            "seed": self.seed,
            "heads": self.titles,
            "scales_db": self.scales.tolist(),
            "best": self.best.tolist(),
            "comparisons": [
                {
                    "first": each.first.tolist(),
                    "second": each.second.tolist(),
                    "score": each.score,
                }
                for each in self.comparisons
            ],
        }
        return json.dumps(content, indent=1)

    def save(self, path: str | Path) -> None:
        """Write what is needed to go on (JSON); the file is complete or absent."""
        with atomic_path(path) as temporary:
            temporary.write_text(self.as_json(), encoding="utf-8")

    def _take(self, comparison: RatedPair) -> None:
        number = 2 * (self.count % (GENERATION // 2))
        self._generation[number : number + 2] = comparison.first, comparison.second
        self.comparisons.append(comparison)
        if self.count % (GENERATION // 2) == 0:
            self._evolve()

    def _evolve(self) -> None:
        preference = Preference(self.comparisons, self.scales)
        points = self._generation
        self._strategy.tell(list(points), preference.costs(points).tolist())
        self.best = preference.least(self.best)
        move = self.best - self._strategy.mean
        farthest = STEP * self._strategy.sigma / max(float(np.linalg.norm(move)), 1e-12)
        self._strategy.mean = self._strategy.mean + move * min(1.0, farthest)
        self._generation = self._drawn()

    def _drawn(self) -> Array:
        self._strategy.sigma = max(self._strategy.sigma, LEAST_STEP)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of points that were moved in between
            points = np.array(self._strategy.ask())
        return np.clip(points, -FARTHEST, FARTHEST)


def calibration_of(space: HeadSpace, seed: int) -> HeadCalibration:
    """A calibration that begins, in a space of heads.

    Raises UserError if all heads are alike.
    """
    if not space.dimensions:
        raise UserError(
            f"{', '.join(space.titles)}: nothing to compare, expected at least two heads that "
            "differ; add others"
        )
    return HeadCalibration(space.scales, space.titles, seed)


def load_calibration(path: str | Path, space: HeadSpace) -> HeadCalibration:
    """The calibration of a file, to go on with.

    Raises UserError if there is none, or it is of other heads than those of the space.
    """
    path = require_file(path, EXPECTED)
    if path.stat().st_size > LONGEST_FILE:
        raise UserError(f"{path}: has more than {LONGEST_FILE:,} bytes, expected {EXPECTED}")
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["kind"] != KIND or content["version"] != VERSION:
            raise ValueError("another kind or version")
        seed, titles = int(content["seed"]), [str(each) for each in content["heads"]]
        scales = np.array(content["scales_db"], dtype=float)
        comparisons = [_comparison(each, len(scales)) for each in content["comparisons"]]
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise UserError(f"{path}: cannot be understood ({error!r}), expected {EXPECTED}") from None
    same = titles == space.titles and scales.shape == space.scales.shape
    if not (same and np.allclose(scales, space.scales, rtol=1e-4)):
        raise UserError(
            f"{path}: is of other heads ({', '.join(titles[:3])} ...), expected those of the "
            "folder; name the folder that it was begun with"
        )
    calibration = HeadCalibration(space.scales, titles, seed)
    for comparison in comparisons:
        calibration._take(comparison)
    return calibration


def _comparison(content: dict[str, Any], dimensions: int) -> RatedPair:
    first, second = (np.array(content[key], dtype=float) for key in ("first", "second"))
    for point in (first, second):
        if point.shape != (dimensions,) or not (np.abs(point) <= FARTHEST).all():
            raise ValueError(f"a point of shape {point.shape} or beyond {FARTHEST:g}")
    if content["score"] not in OFFSETS:
        raise ValueError(f"a score of {content['score']}")
    return RatedPair(first, second, int(content["score"]))
