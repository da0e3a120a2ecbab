"""Arguments of `carillon study scaling` from a part of the configuration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from workflow.arguments import options


def arguments(part: Mapping[str, Any]) -> list[str]:
    """How the scaling is measured, from a part of the configuration."""
    ranks = ",".join(map(str, part["ranks"]))
    return options({"modes": part["modes"], "ranks": ranks, "weak": part.get("weak")})
