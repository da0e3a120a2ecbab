"""Arguments of `carillon study convergence` from a part of the configuration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from workflow.arguments import options


def arguments(part: Mapping[str, Any], modes: int, truth: str) -> list[str]:
    """How the convergence of a model is followed; of no more modes than it has."""
    return options({"modes": min(part["modes"], modes), "steps": part["steps"], "truth": truth})
