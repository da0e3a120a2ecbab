"""The search: its process, what it has told, and how it is stopped."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from carillon.errors import UserError
from studio.processes.worker import Worker
from studio.session.document import Material

MOST_ROWS = 4000
"""Most rows of a search's history that is shown; of more, every second one is left out."""

_COUNTED = ("cost", "evaluations")
"""Keys of a row that make it news; time alone is not."""


@dataclass(frozen=True)
class Live:
    """The best material of a search that goes on, and what it is likely to sound at [Hz]."""

    material: Material
    hertz: list[float]
    cost: float


class Searching:
    """A search at a time, in the phase `idle`, `starting` or `running`; `rows` are the history of
    the present material, and `checks` what was found on the fine solid meanwhile.  `found` is the
    material that was told last, and `best_checked` are the coordinates of the best one by checks.

    `told` is called with every piece of news, the event `progress`, and `found` with every better
    material.
    """

    def __init__(
        self, told: Callable[[dict[str, Any]], None], found: Callable[[Live], None]
    ) -> None:
        self._told, self._tell_found = told, found
        self._worker = Worker("studio.processes.search:SearchProcess")
        self._is_broken_off = False
        self.phase = "idle"
        self.rows: list[dict[str, float]] = []
        self.checks: list[dict[str, float]] = []
        self._former_checks: list[dict[str, float]] = []
        self.found: Material | None = None
        self.best_checked: list[float] | None = None

    def warm(self) -> None:
        """Start the process, so that a search begins sooner."""
        self._worker.start()

    async def run(self, problem: bytes, material: Material | None, out: Path) -> Material | None:
        """Search from a material until the budget is spent or it is stopped.

        What was found has its design in `out`; None if the search was broken off.  Raises UserError
        if there was nothing to search from, or the process ended.
        """
        self.phase, self._is_broken_off = "starting", False
        self._former_checks = self.checks
        self.found = self.best_checked = None
        initial = None if material is None else material.design
        z = None if material is None or material.design is not None else list(material.z)
        try:
            result = await self._worker.call(
                "run", problem, initial, z, self.rows, str(out), tell=self._take
            )
        except UserError:
            if self._is_broken_off:
                return None
            raise
        finally:
            self.phase = "idle"
        self.rows = _thinned(result["rows"])
        self.checks = [*self._former_checks, *result["checks"]]
        return Material(tuple(result["z"]), result["design"])

    def end(self) -> None:
        """End the process."""
        self._worker.end()

    def break_off(self) -> None:
        """End the search at once; what it has told is all there is of it."""
        self._is_broken_off = True
        self._worker.end()

    def forget(self) -> None:
        """Begin a new history: that of another solid."""
        self.rows, self.checks = [], []

    def _take(self, news: dict[str, Any]) -> None:
        if self._is_broken_off:
            return
        if self.phase == "starting":
            self.phase = "running"
        z, hertz = news.pop("z", None), news.pop("hertz", None)
        self.checks = [*self._former_checks, *news.pop("checks")]
        self.best_checked = news.pop("best_checked", None)
        same = self.rows and all(self.rows[-1][key] == news[key] for key in _COUNTED)
        rows = self.rows[:-1] if same else self.rows
        self.rows = _thinned([*rows, news])
        self._told({**news, "checks": self.checks})
        if z is not None:
            self.found = Material(tuple(z))
            self._tell_found(Live(self.found, hertz, news["cost"]))


def _thinned(rows: list[dict[str, float]]) -> list[dict[str, float]]:
    return rows if len(rows) <= MOST_ROWS else rows[::2]
