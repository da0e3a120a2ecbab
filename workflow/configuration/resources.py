"""Memory and time that a job of a rule may take; no result depends on them."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Le

from carillon.parameters import option, parameters


@dataclass(frozen=True)
class JobLimits:
    """What a job of a rule may take at first; one that ran out of it gets twice as much."""

    what: str
    """What the rule makes."""
    memory_mb: int | None
    """Memory of a job, or of each rank if it has any [MB]; None if the rule works it out."""
    minutes: int
    """Wall time [min]."""


LIMITS = {
    "generate_shard": JobLimits("a shard of training data, by its number of workers", None, 120),
    "generate_default_shard": JobLimits("the same for the forests of the package", None, 240),
    "describe_shard": JobLimits("summary of a shard, for which all of it is checked", 1000, 60),
    "grow_tree": JobLimits("a tree of the run's own forests, by its rows", None, 240),
    "grow_default_tree": JobLimits("a tree of the forests of the package, by its rows", None, 240),
    "train_forests": JobLimits("leaves of the run's own forests, by their number", None, 240),
    "train_default_forest": JobLimits(
        "leaves of the forests of the package, by their number", None, 240
    ),
    "find_modes": JobLimits("modes of a model by a variant", 8000, 120),
    "compare_with_truth": JobLimits("all variants of a model beside the truth", 4000, 30),
    "audit_spectra": JobLimits("audit of a model's spectra", 6000, 30),
    "strike_solid": JobLimits("response of a model to a strike", 4000, 30),
}
"""The rules of the main chain by name."""


@parameters
class LimitsSection:
    """What a run gives a rule in place of the rule's own limits."""

    memory_mb: Annotated[int, Ge(1), Le(100_000_000)] | None = option(
        None,
        "memory of a job, or of each rank where it has MPI ranks; the rule's own if null [MB]",
    )
    minutes: Annotated[int, Ge(1), Le(1_000_000)] | None = option(
        None, "wall time; the rule's own if null [min]"
    )
