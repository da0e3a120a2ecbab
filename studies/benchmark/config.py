"""What the jobs of the study take, and how they time methods."""

from collections.abc import Mapping
from typing import Any

from workflow.arguments import options
from workflow.configuration.resources import JobLimits

Config = Mapping[str, Any]
LEAST_RESOLUTION = 4
LIMITS = {
    "time_methods": JobLimits("all methods in alternating runs, also in target figures", 8000, 240)
}


def resolution(config: Config, model: str) -> int:
    """Resolution at which a model is timed."""
    part, own = config["times"], config["models"][model]["resolution"]
    chosen: int | None = part["resolution"]
    return chosen or max(LEAST_RESOLUTION, round(part["share"] * own))


def methods(config: Config, model: str) -> list[str]:
    """How a model is timed: by every method, or by those of a design and their rivals."""
    part = config["times"]
    every = part["all_methods"] is None or model in part["all_methods"]
    how: dict[str, Any] = {} if every else {"design": True, "fine_runs": part["slow_runs"]}
    return [*arguments(part), *options(how)]


def arguments(part: Config) -> list[str]:
    """How methods are timed, from a part of the configuration."""
    keys = ("modes", "runs", "slow_runs", "tune", "arpack_regular", "rough", "rivals")
    return options({key: part.get(key) for key in keys})
