"""The search behind the page: it tells what it has found several times a second."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from threading import Event, Lock, Thread
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from sound.design.optimise import optimise
from sound.design.preparation import DesignProblem
from sound.design.search import HistoryEntry, Search
from sound.design.tasks import SearchStep
from sound.project.design import HISTORY, HISTORY_TYPE
from sound.project.design_file import read_design, write_design
from sound.rendering.verdict import with_verdict

Tell = Callable[[dict[str, Any]], None]

TOLD_SECONDS = 0.25
"""Time between two pieces of news."""


class SearchProcess:
    """What the process for the search does."""

    def run(
        self,
        tell: Tell,
        problem: bytes,
        initial: str | None,
        coordinates: Sequence[float] | None,
        rows: Sequence[Mapping[str, float]],
        out: str,
    ) -> dict[str, Any]:
        """Search from given coordinates until the budget is spent; write to `out`.

        `initial` is a design whose history goes on; without one, that of `rows` does.
        """
        prepared: DesignProblem = pickle.loads(problem)
        start = None if initial is None else read_design(initial)
        history = None if coordinates is None else history_of(rows)
        former = history if start is None else start.history
        news = _News(tell, 0.0 if former is None or not len(former) else former["seconds"][-1])
        with news:
            design = optimise(
                prepared,
                start,
                watch=news.watch,
                follow=news.follow,
                coordinates=None if coordinates is None else np.asarray(coordinates),
                history=history,
            )
        design = with_verdict(design)
        write_design(out, design)
        return {
            "design": out,
            "z": design.coordinates.tolist(),
            "rows": rows_of(design.history),
            "checks": news.checks,
            "verdict": design.evidence.get("verdict"),
        }


class _News:
    """Tells the best material of a leg as it gets better, the processor time of the search, and
    its checks on the fine solid.

    Former searches took so many seconds `before`.
    """

    def __init__(self, tell: Tell, before: float) -> None:
        self._send, self._before = tell, float(before)
        self._lock = Lock()
        self._ended = Event()
        self._search: Search | None = None
        self._checks = 0
        self._best: tuple[SearchStep, Array] | None = None
        self._is_new = False
        self._since = self._told = 0.0

    def __enter__(self) -> _News:
        self._thread = Thread(target=self._tell_on, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def follow(self, step: SearchStep, hertz: Array) -> None:
        """Take up a step; costs of steps can be compared between two checks alone."""
        with self._lock:
            self._since = step.seconds
            checks = 0 if self._search is None else len(self._search.checks)
            best = None if checks != self._checks else self._best
            self._checks = checks
            if best is None or step.cost.total < best[0].cost.total:
                self._best, self._is_new = (step, hertz), True

    def watch(self, search: Search) -> None:
        """Look at the search after a round."""
        with self._lock:
            self._search, self._since = search, 0.0

    def _tell_on(self) -> None:
        while not self._ended.wait(TOLD_SECONDS):
            with self._lock:
                best, is_new, search = self._best, self._is_new, self._search
                self._is_new, since = False, self._since
            if search is None or not search.history:
                continue
            entry = search.history[-1]
            self._told = max(self._told, entry.seconds + since)
            news = _row(entry, best, is_new, self._told) | {"checks": self.checks}
            if search.best_checked is not None:
                news["best_checked"] = search.best_checked.z.tolist()
            self._send(news)

    @property
    def checks(self) -> list[dict[str, float]]:
        """What the checks have found, at times since the first of all searches began."""
        checks = [] if self._search is None else list(self._search.checks)
        return [{**asdict(each), "seconds": self._before + each.seconds} for each in checks]


def _row(
    entry: HistoryEntry, best: tuple[SearchStep, Array] | None, is_new: bool, seconds: float
) -> dict[str, Any]:
    cost = entry.cost if best is None else best[0].cost
    news: dict[str, Any] = {
        "seconds": seconds,
        "evaluations": entry.evaluations,
        "cost": cost.total,
        "frequency_cost": cost.frequency,
        "amplitude_cost": cost.amplitude,
        "regulariser": cost.regulariser,
    }
    if best is not None and is_new:
        step, hertz = best
        news |= {"z": step.z.tolist(), "hertz": hertz.tolist()}
    return news


def rows_of(history: NDArray[np.void]) -> list[dict[str, float]]:
    """A design's history as the page gets it, one row for each entry."""
    return [dict(zip(HISTORY, entry, strict=True)) for entry in history.tolist()]


def history_of(rows: Sequence[Mapping[str, Any]]) -> NDArray[np.void]:
    """The history of a design whose rows are these."""
    return np.array([tuple(row[name] for name in HISTORY) for row in rows], HISTORY_TYPE)
