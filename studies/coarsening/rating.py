"""Errors of single modes of a coarse model, by number and by shape, and those expected."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import scipy.stats

from carillon.arrays import Array
from carillon.fem.geometry import Blocks, prolongation
from carillon.fem.model import RIGID_MODES, ElasticModel
from solver.files.modes_file import frequencies
from solver.refinement.estimate import nodal_mass_matrix
from solver.verification.matching import (
    SAME,
    frequency_errors,
    match_modes,
    mode_overlaps,
    recognised,
)
from studies.coarsening.blame import Blame
from studies.coarsening.picture_file import ModePicture

FAR_OFF = 0.10
"""Relative error of a frequency from which a mode is given a verdict."""

SWAP, LOCAL, ERROR = "swap", "local", "error"
"""Verdicts: the mode is there, and good, under another number; no coarse mode resembles it, so it
lives where the coarse mesh does not resolve it; it is there at a wrong frequency."""


@dataclass(frozen=True)
class SolvedModel:
    """A model with its eigenvalues (k,) and mass-normalised modes (n_dofs, k), rigid ones first."""

    model: ElasticModel
    values: Array
    vectors: Array


class CoarseRating:
    """A coarse model compared with the fine one, mode by mode.

    Parameters
    ----------
    truth
        The fine solid's solution.
    blocks, coarse
        The coarse mesh, plain or mixed, and the solution on it, with as many modes as are rated or
        more: modes may be found under higher numbers.
    expected
        Errors (k,) expected of the frequencies of modes 7, 8, ...
    last
        Number of the last mode that is rated, if there are so many.
    """

    def __init__(
        self, truth: SolvedModel, blocks: Blocks, coarse: SolvedModel, expected: Array, last: int
    ) -> None:
        self._truth, self._blocks, self._coarse = truth, blocks, coarse
        last = min(last, len(truth.values), len(coarse.values), RIGID_MODES + len(expected))
        self._rated = slice(RIGID_MODES, last)
        self.exact = frequencies(truth.values)[self._rated]
        self._found = frequencies(coarse.values)[RIGID_MODES:]
        self.errors = self._found[: len(self.exact)] / self.exact - 1.0
        self.expected = expected[: len(self.exact)]
        overlaps = coarse_overlaps(
            truth.model,
            truth.vectors[:, self._rated],
            blocks,
            np.ascontiguousarray(coarse.vectors[:, RIGID_MODES:]),
        )
        self.matching = match_modes(overlaps)
        self.matched_errors = self._found[self.matching.partners] / self.exact - 1.0
        self._far = np.flatnonzero(np.abs(self.errors) > FAR_OFF)
        elastic = RIGID_MODES + self._far
        self._blame = Blame(
            blocks,
            coarse.model,
            truth.model,
            truth.values[elastic],
            np.ascontiguousarray(truth.vectors[:, elastic]),
        )

    def as_dict(self) -> dict[str, Any]:
        """Plain values.

        `by_index`, `by_projection`, `expected` sum up errors; `recognised` does so for the modes
        whose partner resembles them, see `matching.recognised`. `modes` has them
        all, `far_off` those more than `FAR_OFF` off with the elements to blame.
        """
        summaries = {
            "by_index": self.errors,
            "by_projection": self.matched_errors,
            "expected": self.expected,
        }
        return {
            **{
                name: asdict(frequency_errors(errors, RIGID_MODES + len(errors)))
                for name, errors in summaries.items()
            },
            "recognised": recognised(self.matched_errors, self.matching.overlaps),
            "rank_correlation": rank_correlation(self.expected, self.errors),
            "modes": [self._mode(index) for index in range(len(self.exact))],
            "far_off": [self._far_off(index) for index in range(len(self._far))],
        }

    def pictures(self, count: int) -> list[ModePicture]:
        """Of the modes that are farthest off; those under another number last: nothing is wrong."""
        far = [self._far_off(index) for index in range(len(self._far))]
        order = sorted(
            range(len(far)), key=lambda at: (far[at]["verdict"] == SWAP, -abs(far[at]["error"]))
        )
        return [self._picture(index) for index in order[:count]]

    def _picture(self, index: int) -> ModePicture:
        column = RIGID_MODES + int(self._far[index])
        return ModePicture(
            column + 1,
            self._truth.vectors[:, column].reshape(-1, 3),
            self._blame.cell_energy[:, index],
            self._blame.cell_blamed(index),
        )

    def _mode(self, index: int) -> dict[str, Any]:
        partner = int(self.matching.partners[index])
        return {
            "mode": RIGID_MODES + 1 + index,
            "exact_hz": float(self.exact[index]),
            "coarse_hz": float(self._found[index]),
            "error": float(self.errors[index]),
            "expected_error": float(self.expected[index]),
            "partner": RIGID_MODES + 1 + partner,
            "overlap": float(self.matching.overlaps[index]),
            "largest_overlap": float(self.matching.largest[index]),
            "matched_error": float(self.matched_errors[index]),
        }

    def _far_off(self, index: int) -> dict[str, Any]:
        mode = self._mode(int(self._far[index]))
        return {
            **mode,
            "verdict": verdict(mode["matched_error"], mode["overlap"], mode["largest_overlap"]),
            "half_of_energy": self._blame.half_of_energy(index),
            "elements": self._blame.worst_elements(index),
        }


def rank_correlation(left: Array, right: Array) -> float | None:
    """Spearman's rank correlation of two series (k,); None if one is constant or too short.

    Examples
    --------
    >>> rank_correlation(np.array([0.1, 0.2, 0.4]), np.array([1.0, 3.0, 9.0]))
    1.0
    """
    if min(np.ptp(left, axis=0), np.ptp(right, axis=0)) == 0.0:
        return None
    return float(scipy.stats.spearmanr(left, right).statistic)


def coarse_overlaps(fine: ElasticModel, modes: Array, blocks: Blocks, coarse_modes: Array) -> Array:
    """Overlaps (k, l) of fine modes (n_dofs, k) and coarse ones (coarse n_dofs, l).

    See `solver.verification.matching.mode_overlaps`; coarse modes are prolonged to the fine nodes.
    """
    nodal = prolongation(blocks) @ coarse_modes.reshape(blocks.coarse.n_nodes, -1)
    weighted = nodal_mass_matrix(fine) @ nodal
    shape = (-1, coarse_modes.shape[1])
    return mode_overlaps(modes, nodal.reshape(shape), weighted.reshape(shape))


def verdict(error: float, overlap: float, largest: float) -> str:
    """What is wrong with a mode whose frequency is far off the one of its number.

    Parameters
    ----------
    error
        Relative error of its partner's frequency.
    overlap, largest
        With its partner and with any coarse mode.
    """
    if overlap >= SAME and abs(error) <= FAR_OFF:
        return SWAP
    return ERROR if largest > SAME else LOCAL
