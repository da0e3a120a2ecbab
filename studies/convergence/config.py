"""What the jobs of the study take, and how they follow the corrections."""

from collections.abc import Mapping
from typing import Any

from workflow.arguments import options
from workflow.configuration.resources import JobLimits

LIMITS = {
    "follow_convergence": JobLimits(
        "history of the corrections in the report of the run", 8000, 120
    )
}


def arguments(part: Mapping[str, Any], modes: int, truth: str) -> list[str]:
    """How the convergence of a model is followed; of no more modes than it has."""
    return options({"modes": min(part["modes"], modes), "steps": part["steps"], "truth": truth})
