"""Power laws of what a job takes, fitted to measurements, and what is known of the rules."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from carillon.files.yaml_input import read_own_yaml

Rates = Mapping[str, Any]
"""See `workflow/schemas/rates.schema.yaml`."""
Sizes = Mapping[str, float]

KNOWN: dict[str, Any] = read_own_yaml(Path(__file__).with_name("rules.yaml"))
"""The stages, and what is known of the rules."""

QUANTITIES = ["seconds", "memory_mb", "files_mb"]
"""What there are laws of: start + factor x product of size^power."""

LEAST = 1e-3
"""Smallest amount beyond starting [s] or [MB] that is taken for more than noise."""

HABIT = 0.1
"""Weight of the middle of an exponent's bounds, beside 1 of a job that hardly needs to start."""


def known_of(rule: str, variant: str = "") -> dict[str, Any]:
    """What is known of a rule for a variant: at least its stage, and the name of its law."""
    rules = KNOWN["rules"]
    own = rules.get(f"{rule} {variant}", rules.get(rule, {}))
    known = {"stage": KNOWN["others"], "law": rule, **own}
    return known | {"law": known["law"].format(variant=variant)}


def amounts(laws: Mapping[str, Any], sizes: Sizes) -> list[float]:
    """What a job takes beyond starting, in the order of `QUANTITIES`."""
    return [
        law["factor"] * math.prod(sizes[size] ** power for size, power in law["powers"].items())
        for law in (laws[name] for name in QUANTITIES)
    ]


def fit(
    bounds: Mapping[str, float | Sequence[float]],
    sizes: Sequence[Sizes],
    took: ArrayLike,
    start: float = 0.0,
) -> dict[str, Any]:
    """Law of what jobs take, by least squares in logarithms with bounded exponents.

    A job counts by what it took beyond `start` over all that it took, as does its noise. Exponents
    that the jobs do not tell are in the middle of their bounds.

    Parameters
    ----------
    bounds
        The exponent of every size, or the least and the largest one.
    sizes, took
        Of every job.

    Examples
    --------
    >>> sizes = [{"unknowns": n, "rows": 5.0} for n in (1e2, 1e4, 1e6)]
    >>> took = [2.0 + n["rows"] * n["unknowns"] ** 1.6 for n in sizes]
    >>> law = fit({"unknowns": [1, 2], "rows": 1}, sizes, took, 2.0)
    >>> round(law["powers"]["unknowns"], 2), law["powers"]["rows"]
    (1.6, 1.0)
    """
    from scipy.optimize import lsq_linear

    low, high = np.array([np.broadcast_to(each, 2) for each in bounds.values()]).reshape(-1, 2).T
    logs = np.log([[each[name] for name in bounds] for each in sizes])
    took = np.maximum(np.asarray(took, dtype=float), LEAST)
    more = np.maximum(took - start, LEAST)
    weights = more / took
    # Unknown are the logarithm of the factor, and where between its bounds each exponent is.
    matrix = weights[:, None] * np.column_stack([np.ones(len(logs)), logs * (high - low)])
    habit = HABIT * np.eye(len(low) + 1)[1:]
    goal = [*(weights * (np.log(more) - logs @ low)), *np.full(len(low), HABIT / 2)]
    limits = [-np.inf, *np.zeros(len(low))], [np.inf, *np.ones(len(low))]
    factor, *between = lsq_linear(np.vstack([matrix, habit]), goal, limits).x
    powers = dict(zip(bounds, map(float, low + between * (high - low))))
    return {"start": float(start), "factor": float(np.exp(factor)), "powers": powers}
