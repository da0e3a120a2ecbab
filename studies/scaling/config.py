"""What the jobs of the study take, and how they measure."""

from collections.abc import Mapping
from typing import Any

from workflow.arguments import options
from workflow.configuration.resources import JobLimits

LIMITS = {
    "measure_scaling": JobLimits("wall time over ranks, also in the report of the run", 16000, 120)
}


def arguments(part: Mapping[str, Any]) -> list[str]:
    """How the scaling is measured, from a part of the configuration."""
    ranks = ",".join(map(str, part["ranks"]))
    return options({"modes": part["modes"], "ranks": ranks, "weak": part.get("weak")})
