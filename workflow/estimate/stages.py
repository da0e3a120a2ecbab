"""What every stage of a run takes: its jobs, their memory, and the files that they leave."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from workflow.estimate.machine import Jobs, Machine
from workflow.estimate.rates import Rates

FAR = 5.0
"""How many times what was measured counts as far beyond it."""

MEGABYTE = 1e6


@dataclass(frozen=True)
class Stage:
    """A part of the run.

    Attributes
    ----------
    name, target : what it is, and the target of Snakemake that it belongs to.
    jobs : its jobs, which do not wait for each other.
    basis : where seconds, memory and files come from, by these names.
    kept_mb, scratch_mb : files that stay, and those that are there in between as well.
    cautions : what is far beyond anything that was measured.
    continues : whether it is done by the job of the stage before.
    """

    name: str
    target: str
    jobs: tuple[Jobs, ...]
    basis: Mapping[str, str]
    kept_mb: float = 0.0
    scratch_mb: float = 0.0
    cautions: tuple[str, ...] = ()
    continues: bool = False

    @property
    def count(self) -> int:
        """Number of jobs that it adds."""
        return 0 if self.continues else sum(jobs.count for jobs in self.jobs)

    @property
    def core_hours(self) -> float:
        """Core-hours that its jobs occupy."""
        return sum(jobs.core_hours for jobs in self.jobs)

    @property
    def memory_mb(self) -> float:
        """Peak memory of its largest job."""
        return max((jobs.memory_mb for jobs in self.jobs), default=0.0)


@dataclass(frozen=True)
class Run:
    """What is run where: a complete configuration, rates, a machine."""

    config: Mapping[str, Any]
    rates: Rates
    machine: Machine

    @property
    def numbers(self) -> Mapping[str, float]:
        """Costs by name."""
        return self.rates.numbers

    def cores(self, ranks: int) -> int:
        """Cores of a job that takes all it may, with so many ranks."""
        wanted = self.config["solver"]["cores"] or self.machine.cores_per_node
        return self.machine.granted(wanted, ranks)

    def beyond(self, stage: str, wanted: float, what: str, told: str) -> Iterator[str]:
        """A sentence if something is far beyond what was measured."""
        measured = self.rates.up_to[what]
        if wanted > FAR * measured:
            yield (
                f"{stage}: {wanted:,.0f} {what} are far beyond the {measured:,} that were measured;"
                f" {told} are extrapolated {wanted / measured:,.0f}-fold"
            )
