"""A model of the wall time on any number of ranks, phase by phase:

    t(phase) = flops / rate + bytes / bandwidth + messages * latency    of the busiest rank

Operations are counted, see `studies.scaling.work`; the rates are those of the measured runs.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from solver import rank_scaling
from solver.hcms.counts import SENT_A_COLUMN, SHARED_COST
from solver.rank_scaling import BANDWIDTH, LATENCY
from studies.scaling.work import Work

MISFIT_LIMIT = 0.3
"""Largest relative difference from the measurements with which the model goes beyond them."""
MODELLED = ("assembly", "local", "merge", "down", "basis", "factor", "solve", "dense")
"""Kinds of phases; every level of the merge tree is of the kind `merge`."""
ASSUMPTIONS = (
    "every rank is one core with the rates that were measured here, whatever runs beside it",
    "phases follow each other, and so do the levels of the merge tree: who has less to do waits",
    "the rate of a kind of phase is the same for all sizes: small matrices cost no more per "
    "operation than large ones",
    "subdomains and merges are dealt and shared as the solver deals them; the operations of each "
    "are those of a compact group of so many nodes and modes",
    f"an eigenproblem shared by ranks takes {SHARED_COST:g} times as many operations, as on two "
    f"ranks here, evenly divided, and {SENT_A_COLUMN} messages a column and direction of the grid",
    *rank_scaling.ASSUMPTIONS,
    "a sum over the ranks takes log2(ranks) rounds of its whole payload",
    "corrections and right-hand sides are as many as were measured on the fewest ranks",
    "there are as many subdomains as ranks at least, which are then smaller",
    "partition and elimination plan are not in it: they are made once for any material",
)
"""Assumptions of the model."""
WEAK_ASSUMPTIONS = ("the subdomains of a solid that grows are equally large and joined in pairs",)
"""Assumptions where the solid grows with the ranks."""

Run = dict[str, Any]
Row = dict[str, Any]


@dataclass(frozen=True)
class MachineRates:
    """What a rank and a link do per second."""

    rates: dict[str, float]
    """Operations per second by kind of phase."""
    latency: float = LATENCY
    """Seconds a message."""
    bandwidth: float = BANDWIDTH
    """Bytes per second."""

    def predict(self, work: Work) -> dict[str, float]:
        """Modelled seconds of every phase."""
        return {
            phase: each.flops / self.rates[kind(phase)]
            + each.bytes / self.bandwidth
            + each.messages * self.latency
            for phase, each in work.items()
        }

    def as_dict(self) -> dict[str, Any]:
        """Plain dictionary, ready for JSON."""
        return asdict(self)


def kind(phase: str) -> str:
    """Kind of a phase.

    Examples
    --------
    >>> kind("merge 3"), kind("local")
    ('merge', 'local')
    """
    return phase.split()[0]


def fit_machine(
    runs: Sequence[tuple[Run, Work]], latency: float | None = None, bandwidth: float | None = None
) -> MachineRates:
    """Rates from measured runs and their counted work; runs on more ranks than cores fit nothing.

    A rate is the operations of its kind over the time of the ranks that wait least.  Latency and
    bandwidth are those between two ranks, unless given.
    """
    fair = [each for each in runs if not each[0]["oversubscribed"]] or list(runs[:1])
    flops, seconds = dict.fromkeys(MODELLED, 0.0), dict.fromkeys(MODELLED, 0.0)
    for run, work in fair:
        for phase, tally in work.items():
            flops[kind(phase)] += tally.flops
            seconds[kind(phase)] += _busy(run["phases"][phase])
    rates = {
        name: flops[name] / seconds[name] if flops[name] > 0.0 else np.inf for name in MODELLED
    }
    links = [run["link"] for run, _ in fair if run["link"] is not None]
    measured = {"latency": LATENCY, "bandwidth": BANDWIDTH}
    if links:
        measured = {name: float(np.median([link[name] for link in links])) for name in measured}
    return MachineRates(
        rates,
        measured["latency"] if latency is None else latency,
        measured["bandwidth"] if bandwidth is None else bandwidth,
    )


def as_far_as_it_fits(runs: Sequence[Run], rows: Sequence[Row]) -> dict[str, Any]:
    """The model's rows with its misfit and `fit`, a sentence about it.

    The misfit is the largest relative difference from the runs that have their cores (the first run
    if none has), None if the model has no row for any.  Rows of ranks that were not measured are
    left out where it is above `MISFIT_LIMIT`.
    """
    fair = [run for run in runs if not run["oversubscribed"]] or list(runs[:1])
    totals = {row["ranks"]: row["total"] for row in rows}
    differences = [
        abs(totals[run["ranks"]] / run["seconds"] - 1.0) for run in fair if run["ranks"] in totals
    ]
    misfit = max(differences, default=None)
    if misfit is None:
        sentence = "The model has no measurement to be compared with"
    else:
        sentence = f"The model differs from the measurements by up to {misfit:.0%}"
        if misfit <= MISFIT_LIMIT:
            return {"misfit": misfit, "fit": f"{sentence}.", "rows": list(rows)}
        sentence += f", more than {MISFIT_LIMIT:.0%}"
    measured = {run["ranks"] for run in runs}
    return {
        "misfit": misfit,
        "fit": f"{sentence}: its times on other numbers of ranks are left out.",
        "rows": [row for row in rows if row["ranks"] in measured],
    }


def _busy(phase: dict[str, list[float]]) -> float:
    """Longest time [s] that a rank worked in a phase."""
    waiting = phase.get("waiting", [0.0] * len(phase["seconds"]))
    return max(seconds - idle for seconds, idle in zip(phase["seconds"], waiting, strict=True))
