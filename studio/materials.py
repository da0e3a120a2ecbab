"""Materials by name as the page lists them."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from carillon.composition.materials import MATERIALS, named_material

HERTZ = 1000.0
"""Frequency [Hz] at which loss factors are told."""


@cache
def material_table() -> list[dict[str, Any]]:
    """Each material's name, what it is, and its constants [Pa], [1], [kg/m^3]."""
    return [_row(name) for name in MATERIALS]


def _row(name: str) -> dict[str, Any]:
    material = named_material(name)
    omega = 2.0 * np.pi * HERTZ
    return {
        "name": name,
        "about": material.about,
        "young": material.young,
        "poisson": material.poisson,
        "density": material.density,
        "loss_factor": float(f"{material.alpha / omega + material.beta * omega:.3g}"),
        "colour": list(material.colour),
        "wood": material.is_wood,
        "grain_young": None if material.grain_young is None else list(material.grain_young),
    }
