"""What every job takes, from its sizes, the measured laws and the machine."""

from __future__ import annotations

import heapq
from collections.abc import Iterable
from typing import Any, NamedTuple

import pandas as pd

from workflow.estimate.laws import KNOWN, Rates, amounts, known_of
from workflow.estimate.plan import TARGETS
from workflow.estimate.sizes import is_solved_in_full, sizes_of
from workflow.variants import VARIANTS


class Machine(NamedTuple):
    """Equal nodes."""

    nodes: int
    cores_per_node: int

    @property
    def cores(self) -> int:
        """All cores."""
        return self.nodes * self.cores_per_node

    def granted(self, cores: int, ranks: int = 1) -> int:
        """Cores that a job asking for so many can get; ranks may lie on several nodes."""
        return min(cores, self.cores_per_node if ranks == 1 else self.cores)

    def slots(self, cores: int) -> int:
        """Jobs of so many cores each that run at a time."""
        if cores > self.cores_per_node:
            return max(1, self.cores // cores)
        return self.nodes * (self.cores_per_node // cores)

    def wall(self, jobs: Iterable[tuple[float, int]]) -> float:
        """Wall time of independent jobs by their times and cores.

        Those of equal cores run together, the longest first.

        Examples
        --------
        >>> Machine(1, 4).wall([(10.0, 2), (6.0, 2), (6.0, 2), (1.0, 4)])
        13.0
        """
        free: dict[int, list[float]] = {}
        for time, cores in sorted(jobs, reverse=True):
            slots = free.setdefault(cores, [0.0] * self.slots(cores))
            heapq.heapreplace(slots, slots[0] + time)
        return sum(map(max, free.values()))


def costs(jobs: pd.DataFrame, rates: Rates, machine: Machine) -> pd.DataFrame:
    """The jobs of `plan` with what they take.

    A solid that is solved in full where a coarse one would not pay takes what the fine one takes.
    Columns beside theirs are `sizes`, `stage`, `law` (empty if it is not measured), `granted`
    cores, `hours` of wall time, `core_hours`, `memory_gb` (peak), `kept_gb` (files that stay) and
    `journal_gb` (files until the job is done).
    """
    jobs = jobs.assign(sizes=sizes_of(jobs, rates["fits_per_second"]))
    taken = [_cost(job, rates, machine) for job in jobs.itertuples()]
    jobs = jobs.join(pd.DataFrame(taken, index=jobs.index))
    return jobs.assign(core_hours=jobs["hours"] * jobs["granted"])


def _cost(job: Any, rates: Rates, machine: Machine) -> dict[str, Any]:
    known, cores = known_of(job.rule, job.variant), machine.granted(job.cores, job.ranks)
    name = known["law"]
    if is_solved_in_full(job.command):
        name = known_of(job.rule, _fine_variant(job.variant))["law"]
    rate, law, files = rates["laws"].get(name), "", 0.0
    if rate is not None:
        law, (seconds, memory, files) = name, amounts(rate, job.sizes)
        serial = known.get("serial", serial_share(rates))
        copies = {"cores": cores, "ranks": job.ranks}.get(known.get("each", ""), 1)
        seconds = rate["seconds"]["start"] + (serial + (1.0 - serial) / cores) * seconds
        memory = max(copies, job.ranks) * rate["memory_mb"]["start"] + copies * memory
    elif job.local:
        short = rates["laws"][KNOWN["short"]]
        seconds, memory = short["seconds"]["start"], short["memory_mb"]["start"]
    else:
        seconds, memory = 60.0 * (job.minutes or 0.0), job.memory_mb or 0.0
    return {
        "stage": TARGETS[1] if job.target == TARGETS[1] else known["stage"],
        "law": law,
        "granted": cores,
        "hours": seconds / 3600.0,
        "memory_gb": memory / 1000.0,
        "kept_gb": files / 1000.0,
        "journal_gb": files / 1000.0 if known.get("journal") else 0.0,
    }


def _fine_variant(variant: str) -> str:
    """The variant that solves the fine solid as this one solves a coarse one.

    Examples
    --------
    >>> _fine_variant("ddfem_hcms_ec"), _fine_variant("ddfem_slepc")
    ('hcms_ec', 'truth')
    """
    asked = VARIANTS[variant]
    how = ("none", asked.method, asked.corrected)
    return next(
        name
        for name, each in VARIANTS.items()
        if (each.coarsen, each.method, each.corrected) == how
    )


def serial_share(rates: Rates) -> float:
    """Share of a solver run on one core that more cores do not shorten."""
    measured = rates["serial_share"]
    return float(KNOWN["assumed_share"] if measured is None else measured)
