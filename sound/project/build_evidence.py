"""What a design's file tells of the materials that it is built of."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

_OF_MATERIAL = ("young_pa", "density_kg_per_m3", "fraction", "volume_m3")
"""Numbers that are told of a material."""


def is_build(build: Any, materials: int) -> bool:
    """Whether a design's evidence `build` tells what so many materials are."""
    if not isinstance(build, Mapping) or not isinstance(build.get("materials"), list):
        return False
    width, told = build.get("at_least_m"), build["materials"]
    return (
        (width is None or is_number(width))
        and len(told) == materials
        and all(
            isinstance(each, Mapping)
            and isinstance(each.get("name"), str)
            and all(is_number(each.get(key)) for key in _OF_MATERIAL)
            and _is_colour(each.get("colour"))
            for each in told
        )
    )


def _is_colour(value: Any) -> bool:
    numbers = isinstance(value, list) and len(value) == 3 and all(map(is_number, value))
    return numbers and all(0.0 <= each <= 1.0 for each in value)


def is_number(value: Any) -> bool:
    """Whether a value of JSON is a finite number."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and math.isfinite(value)
