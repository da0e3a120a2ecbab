"""In what the materials of two modes files differ."""

from __future__ import annotations

from typing import Any

import numpy as np

from carillon.fem.model import Solid

EQUAL = 1e-9
"""Largest relative difference of two constants that count as the same."""


def on_one_mesh(one: Solid, other: Solid) -> bool:
    """Whether two solids have the same elements and nodes."""
    return np.array_equal(one.connectivity, other.connectivity) and np.array_equal(
        one.mesh.node_grid, other.mesh.node_grid
    )


def material_difference(one: Solid, truth: Solid) -> dict[str, Any] | None:
    """In what the material of a solid differs from the truth's; None where it is the same.

    Young's moduli are compared on one mesh alone, since a coarse element has moduli of its own.

    Returns
    -------
    dict
        Of what differs: `poisson` and `density_kg_per_m3`, each with the solid's own value and the
        truth's, and `young`: the number of `cells` that differ, that of `all`, and the `largest`
        relative difference (infinite from zero).
    """
    differing: dict[str, Any] = {}
    for name, a, b in (
        ("poisson", one.poisson, truth.poisson),
        ("density_kg_per_m3", one.density, truth.density),
    ):
        if abs(a - b) > EQUAL * abs(b):
            differing[name] = [float(a), float(b)]
    if on_one_mesh(one, truth) and one.young.shape == truth.young.shape:
        step = np.abs(one.young - truth.young)
        other = step > EQUAL * np.abs(truth.young)
        if other.any():
            # One row a cell, whatever values it has.
            cells = other.reshape(len(other), -1).any(axis=1)
            with np.errstate(divide="ignore"):
                largest = float((step[other] / np.abs(truth.young[other])).max())
            differing["young"] = {
                "cells": int(cells.sum()),
                "all": len(cells),
                "largest": largest,
            }
    return differing or None
