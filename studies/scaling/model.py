"""A model of the wall time on any number of ranks: operations, bytes and messages at fixed rates.

    t(phase) = flops / rate + bytes / bandwidth + messages * latency    of the busiest rank

It rests on `ASSUMPTIONS`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.distribution.decomposition import COST_EXPONENT
from solver.distribution.tree import assign_ranks
from solver.hcms.counts import SENT_A_COLUMN, SHARED_COST, Tally
from studies.scaling.counting import rounds
from studies.scaling.plan import planned_counts
from studies.scaling.sizes import TreeSizes
from studies.scaling.work import Factorisation, dense_flops

Array = NDArray[np.float64]
Busiest = dict[str, Tally]

ASSUMED_LATENCY, ASSUMED_BANDWIDTH = 2e-6, 5e9
"""Seconds a message and bytes per second where only one rank was measured."""
MISFIT_LIMIT = 0.3
"""Largest relative difference from the measurements with which the model goes beyond them."""
MODELLED = ("assembly", "local", "merge", "down", "basis", "factor", "solve", "dense")
"""Kinds of phases; every level of the merge tree is of the kind `merge`."""
ASSUMPTIONS = (
    "every rank is one core with the rates that were measured here, whatever runs beside it",
    "phases follow each other, and so do the levels of the merge tree: who has less to do waits",
    "the rate of a kind of phase is the same for all sizes: small matrices cost no more per "
    "operation than large ones",
    "operations of the synthesis are counted merge by merge with the formulas of the solver, for "
    "the ranks that it would have make and share each merge, and those of subdomains and "
    "factorisation estimated from nested dissection",
    f"an eigenproblem shared by ranks takes {SHARED_COST:g} times as many operations, as on two "
    f"ranks here, evenly divided, and {SENT_A_COLUMN} messages a column and direction of the grid",
    "who shares products of modes sends rows and sums to each helper one after the other",
    "factorisation and solves divide evenly over the ranks; their messages are the updates of the "
    "largest front at each of the log2(ranks) uppermost levels",
    "a collective call takes log2(ranks) rounds of its whole payload",
    "corrections and right-hand sides are as many as were measured on the fewest ranks",
    "there are as many subdomains as ranks at least, which are then smaller",
    "partition and elimination plan are not in it: they are made once for any material",
)
"""What the model takes for granted."""
WEAK_ASSUMPTIONS = (
    "the solid is a box of cubic subdomains, each with neighbours on all sides",
    "a solid f times as large takes f^2 operations to factorise, and f^(4/3) entries",
)
"""The same where the solid grows with the ranks."""


@dataclass(frozen=True)
class MachineRates:
    """What a rank and a link do per second.

    Attributes
    ----------
    rates
        Operations per second by kind of phase.
    latency
        Seconds a message.
    bandwidth
        Bytes per second.
    """

    rates: dict[str, float]
    latency: float = ASSUMED_LATENCY
    bandwidth: float = ASSUMED_BANDWIDTH

    def seconds(self, phase: str, work: Tally) -> float:
        """Time of a phase whose busiest rank does `work`."""
        links = work.bytes / self.bandwidth + work.messages * self.latency
        return work.flops / self.rates[kind(phase)] + links

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


def runs_with_cores(runs: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Runs on no more ranks than cores; the first of all if there is none."""
    return [run for run in runs if not run["oversubscribed"]] or list(runs[:1])


def fit_machine(
    runs: Sequence[dict[str, Any]], latency: float | None = None, bandwidth: float | None = None
) -> MachineRates:
    """Rates from measured runs, those on more ranks than cores left out.

    A rate is that of all operations of its kind over all time not spent waiting; it is the one for
    which the times of these phases add up to what was measured.  Latency and bandwidth are those
    between two ranks, unless given.
    """
    fair = runs_with_cores(runs)
    flops = dict.fromkeys(MODELLED, 0.0)
    seconds = dict.fromkeys(MODELLED, 0.0)
    for run in fair:
        for phase, tallies in run["phases"].items():
            if kind(phase) in flops:
                flops[kind(phase)] += sum(tallies["flops"])
                seconds[kind(phase)] += sum(tallies["seconds"]) - sum(tallies["waiting"])
    rates = {name: flops[name] / seconds[name] for name in MODELLED if flops[name] > 0.0}
    links = [run["link"] for run in fair if run["link"] is not None]
    machine = MachineRates({**dict.fromkeys(MODELLED, np.inf), **rates})
    if links:
        machine = replace(
            machine,
            latency=float(np.median([link["latency"] for link in links])),
            bandwidth=float(np.median([link["bandwidth"] for link in links])),
        )
    if latency is not None:
        machine = replace(machine, latency=latency)
    if bandwidth is not None:
        machine = replace(machine, bandwidth=bandwidth)
    return machine


@dataclass(frozen=True)
class CorrectionWork:
    """What the error correction does, as far as it does not depend on the number of ranks.

    Attributes
    ----------
    blocks, solves
        Blocks of right-hand sides, and their columns in all.
    width
        Modes formed.
    """

    blocks: int
    solves: int
    width: int

    @classmethod
    def measured(cls, run: dict[str, Any]) -> CorrectionWork:
        """As a run made it."""
        return cls(run["blocks"], run["right_hand_sides"], run["width"])


def work_of_busiest(
    sizes: TreeSizes, elimination: Factorisation, keep: int, correction: CorrectionWork, ranks: int
) -> Busiest:
    """Work of the busiest rank in every phase on so many ranks, counted without doing it."""
    parts = sizes.tree.parts
    owner = assign_ranks(sizes.nodes[:parts] ** COST_EXPONENT, ranks)
    counts = planned_counts(sizes, owner, keep)
    phases = [each.phases() for each in counts]
    work = {
        phase: Tally(
            max(each[phase].messages for each in phases),
            max(each[phase].bytes for each in phases),
            max(each[phase].flops for each in phases),
        )
        for phase in phases[0]
    }
    unknowns = 3.0 * float(sizes.nodes[-1])
    largest = float(np.bincount(owner, weights=sizes.nodes[:parts]).max() / sizes.nodes[-1])
    levels = rounds(ranks)
    passes = max(correction.blocks, 1)
    shared, alone = dense_flops(unknowns, correction.blocks, correction.solves, correction.width)
    columns = correction.solves / passes
    # Two products with the mass a block; projections on the basis, and Gram matrices.
    halo = 2.0 * 16.0 * _surface(sizes, owner, ranks) * 3 * correction.solves
    reduced = 8.0 * levels * correction.solves * (0.5 * correction.solves + 2.0 * columns)
    return {
        **work,
        "factor": Tally(levels, elimination.update_bytes(levels), elimination.flops / ranks),
        "solve": Tally(
            2 * levels * passes,
            elimination.solve_bytes(levels, correction.solves),
            elimination.solve_flops(correction.solves) / ranks,
        ),
        "dense": Tally(6 * levels * correction.blocks, halo + reduced, largest * shared + alone),
    }


def _surface(sizes: TreeSizes, owner: NDArray[np.integer], ranks: int) -> float:
    """Nodes on the boundary of the rank that has most of them, from those of its subdomains."""
    if ranks == 1:
        return 0.0
    parts = sizes.tree.parts
    nodes = np.bincount(owner, weights=sizes.nodes[:parts])
    boundary = np.bincount(owner, weights=sizes.boundary[:parts])
    count = np.bincount(owner)
    # Subdomains of one rank touch each other: a body's surface grows like its volume to 2/3.
    return float((boundary / np.cbrt(count)).clip(max=nodes).max())


def predict(machine: MachineRates, work: Busiest) -> dict[str, float]:
    """Modelled seconds of every phase."""
    return {phase: machine.seconds(phase, tally) for phase, tally in work.items()}


def misfit(runs: Sequence[dict[str, Any]], rows: Sequence[dict[str, Any]]) -> float | None:
    """Largest relative difference of the model's rows from the runs that have their cores.

    None if the model has no row for any of them.

    Examples
    --------
    >>> runs = [{"ranks": 1, "seconds": 4.0, "oversubscribed": False}]
    >>> misfit(runs, [{"ranks": 1, "total": 3.0}, {"ranks": 2, "total": 2.0}])
    0.25
    """
    modelled = {row["ranks"]: row["total"] for row in rows}
    differences = [
        abs(modelled[run["ranks"]] / run["seconds"] - 1.0)
        for run in runs_with_cores(runs)
        if run["ranks"] in modelled
    ]
    return max(differences, default=None)


def as_far_as_it_fits(
    runs: Sequence[dict[str, Any]], rows: Sequence[dict[str, Any]]
) -> dict[str, Any]:
    """The model's rows with its misfit and `fit`, a sentence about it.

    Rows of ranks that were not measured are left out where the misfit is above `MISFIT_LIMIT`.
    """
    largest = misfit(runs, rows)
    if largest is not None and largest <= MISFIT_LIMIT:
        sentence = f"The model differs from the measurements by up to {largest:.0%}."
        return {"misfit": largest, "fit": sentence, "rows": list(rows)}
    if largest is None:
        sentence = "The model has no measurement to be compared with"
    else:
        sentence = (
            f"The model differs from the measurements by up to {largest:.0%}, more than "
            f"{MISFIT_LIMIT:.0%}"
        )
    measured = {run["ranks"] for run in runs}
    return {
        "misfit": largest,
        "fit": f"{sentence}: its times on other numbers of ranks are left out.",
        "rows": [row for row in rows if row["ranks"] in measured],
    }
