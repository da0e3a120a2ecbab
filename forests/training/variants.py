"""Ways to train that the study compares."""

from __future__ import annotations

from typing import Annotated, Any

from carillon.parameters import OneOf, option, parameters
from forests.scaling import TRANSFORMS
from forests.training.rows import STUDIED
from forests.training.train import TrainingOptions

VARIANTS: dict[str, dict[str, Any]] = {
    "ratios, variance splits (paper)": {"transform": "ratio", "grower": "best"},
    "ratios, log target": {"transform": "ratio-log", "grower": "best"},
    "bounded ratios, log target": {"transform": "bounded", "grower": "best"},
    "logarithms": {"grower": "best"},
    "logarithms, extra-trees": {"grower": "extra"},
    "ratios, log target, linear splits": {"transform": "ratio-log"},
    "bounded ratios, linear splits": {"transform": "bounded"},
    "logarithms, linear splits": {},
    "the same, 1 tree": {"trees": 1},
    "the same, 6 trees": {"trees": 6},
}
"""Trainings that are compared, as what they change of the default one."""


@parameters
class VariantOptions(TrainingOptions):
    """Parameters of a training that is compared, which may have transforms of no evaluator."""

    transform: Annotated[str, OneOf(*TRANSFORMS, *STUDIED)] = option("log")
