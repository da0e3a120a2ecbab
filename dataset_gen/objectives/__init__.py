"""Fit objectives by name: eight fine moduli of a block -> eight coarse moduli of one element.

Every objective is homogeneous of degree one in the fine moduli and equivariant under the cube's 48
symmetries. Each lives in the module of its name, with a function `fit_pattern`.

The names are here; what fits by them, in `fitting`, takes a while to load.
"""

from collections.abc import Iterable
from typing import TYPE_CHECKING

from carillon import lazy_exports
from carillon.errors import UserError
from carillon.parameters.sentences import did_you_mean
from dataset_gen.objectives.calibration import default_calibration

if TYPE_CHECKING:
    from dataset_gen.objectives.fitting import Fits, fit, fit_samples, orientations

__all__ = [
    "DATASET_OBJECTIVES",
    "DEFAULT_OBJECTIVE",
    "OBJECTIVES",
    "SAMPLED",
    "Fits",
    "closed_form",
    "fitted_at",
    "fit",
    "fit_samples",
    "lumped_share",
    "orientations",
    "ratios_of",
    "require_objective",
    "require_poisson",
]

CALIBRATED = "calibrated"
"""The objective that the constants of `calibration` belong to."""
OBJECTIVES = ("energy", "chen2015", "inertial", "oversampled", "hybrid", "factored", CALIBRATED)
"""Names of all objectives, each that of its module."""
SAMPLED = "sampled-energy"
"""`energy` by its printed evaluator, forces drawn anew for every sample of a dataset.

It fits datasets alone: what it answers for a block depends on the sample's number as well.
"""
DATASET_OBJECTIVES = (*OBJECTIVES, SAMPLED)
"""Names of all that a dataset can be fitted by."""
DEFAULT_OBJECTIVE = CALIBRATED
"""The one with the best spectra, see the study that `snakemake objectives` makes."""


def require_objective(objective: str, known: Iterable[str] = OBJECTIVES) -> None:
    """Raise UserError unless `objective` is one of those known."""
    if objective not in known:
        hint = did_you_mean(objective, known)
        raise UserError(
            f"objective {objective!r} is unknown{hint}, choose one of {', '.join(known)}"
        )


def closed_form(objective: str) -> str:
    """Name in `OBJECTIVES` of what a dataset's objective converges to."""
    return "energy" if objective == SAMPLED else objective


def lumped_share(objective: str) -> float:
    """Share of row-sum lumped mass that goes with an objective, in blocks without void cells.

    The others go with the consistent mass P^T M P.
    """
    return default_calibration().lumped_share if objective == CALIBRATED else 0.0


def fitted_at(objective: str, poisson: float) -> float:
    """Poisson's ratio that an objective fits the blocks of a solid of the ratio `poisson` at."""
    return default_calibration().poisson if objective == CALIBRATED else poisson


def ratios_of(objective: str, poisson: float) -> tuple[float, float]:
    """Least and largest Poisson's ratio of the solids that fits at the ratio `poisson` are for.

    Examples
    --------
    >>> ratios_of("calibrated", 0.25), ratios_of("hybrid", 0.25)
    ((0.0, 0.49), (0.25, 0.25))
    """
    calibration = default_calibration()
    if objective == CALIBRATED and poisson == calibration.poisson:
        return calibration.ratios
    return poisson, poisson


def require_poisson(objective: str, poisson: float) -> None:
    """Raise UserError unless Poisson's ratio lies in (-1, 0.5) and the objective is for it."""
    if not -1.0 < poisson < 0.5:
        raise UserError(f"Poisson's ratio {poisson} is outside (-1, 0.5)")
    least, largest = ratios_of(objective, fitted_at(objective, poisson))
    if not least <= poisson <= largest:
        raise UserError(
            f"objective {objective!r} is for Poisson's ratios {least:g} to {largest:g}, found "
            f"{poisson:g}; choose another one, such as hybrid"
        )


__getattr__ = lazy_exports.exports(
    __name__, dict.fromkeys(("Fits", "fit", "fit_samples", "orientations"), "fitting")
)
