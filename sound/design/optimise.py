"""The search for a design."""

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from solver.files.modes_file import frequencies
from sound.design.interrupts import interruptible
from sound.design.optimisers import OPTIMISERS
from sound.design.outcome import Outcome
from sound.design.pool import Pool
from sound.design.preparation import DesignProblem, coordinates_of
from sound.design.search import BudgetSpentError, Search, require_modes
from sound.design.space_mapping import SpaceMapping
from sound.design.tasks import SearchStep, Task
from sound.project.design import HISTORY_TYPE, Design

KEEP_SECONDS = 30.0
"""Time between two intermediate designs of a search [s]."""


def optimise(
    problem: DesignProblem,
    initial: Design | None = None,
    keep: Callable[[Design], None] | None = None,
    watch: Callable[[Search], bool | None] | None = None,
    keep_seconds: float | None = None,
    follow: Callable[[SearchStep, Array], None] | None = None,
    coordinates: Array | None = None,
    history: NDArray[np.void] | None = None,
) -> Design:
    """Search for a material until the project's budget is spent or an interrupt comes.

    The cost of the design is not greater than that of the start, by analyses to `FINAL_TOLERANCE`;
    of a coarse solid with `fine_check`, that is the cost on the fine solid.

    Parameters
    ----------
    problem, initial
        Problem of the project; design to go on from, of the same mesh, whose targets may differ.
    keep, keep_seconds : float or None [s]
        Called with the best design so far so many seconds (`KEEP_SECONDS`), if it is new.
    watch
        Called after every round of evaluations; ends the search by returning True.
    follow
        Called from another thread with every step of a descent and the frequencies (N,) [Hz] of the
        design then, in the order of the modes of the search.
    coordinates, history : (m,), structured array of HISTORY_TYPE, or None
        Coordinates and history of the start, instead of the initial design's.

    Raises
    ------
    UserError
        See `coordinates_of`; or if the material to start from has no modes.
    """
    project, setting = problem.project, problem.setting
    z = np.zeros(setting.material.dimensions)
    before = (0.0, 0)
    rows = np.empty(0, HISTORY_TYPE)
    if initial is not None:
        z = coordinates_of(problem, initial)
        rows = initial.history
    if history is not None:
        rows = history
    if len(rows):
        before = (float(rows["seconds"][-1]), int(rows["evaluations"][-1]))
    if coordinates is not None:
        z = coordinates
    outcome = Outcome(problem, rows)
    budget = project.optimiser
    every = KEEP_SECONDS if keep_seconds is None else keep_seconds
    mapping = None
    if budget.fine_check and setting.is_coarsened:
        mapping = SpaceMapping(setting.objective, outcome.checked)

    def design_of(search: Search) -> Design:
        if mapping is None:
            return outcome.of(search)
        assert mapping.best is not None
        return outcome.of_checked(search, mapping.best)

    def pool(tell: Callable[[SearchStep], None]) -> Pool:
        def pass_on(step: SearchStep) -> None:
            tell(step)
            if follow is not None:
                own = frequencies(step.eigenvalues)
                follow(step, own if mapping is None else mapping.foretold(step))

        return Pool(setting, problem.workers, pass_on)

    kept: float = time.monotonic()
    known: object = None

    with interruptible() as interrupted:

        def look(search: Search) -> bool:
            nonlocal kept, known
            ended = watch is not None and watch(search)
            best = search.best if mapping is None else mapping.best
            is_due = time.monotonic() - kept >= every and best is not known
            if keep is not None and is_due and not ended:
                keep(design_of(search))
                kept, known = time.monotonic(), best
            return bool(ended) or interrupted()

        search = Search(
            pool,
            budget.seconds,
            budget.evaluations,
            look,
            before,
            interrupted,
        )
        with search:
            optimiser = OPTIMISERS[budget.method]
            try:
                search.run([Task(z)])
                require_modes(search)
                if mapping is None:
                    optimiser(search, z, budget.seed, budget.population)
            except BudgetSpentError:
                pass
            if mapping is not None:
                mapping.run(search, optimiser, budget.seed, budget.population)
        return design_of(search)
