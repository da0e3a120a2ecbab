"""Ways to train that the study compares."""

from __future__ import annotations

from typing import Any

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
