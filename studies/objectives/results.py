"""What the study of the objectives has found."""

from __future__ import annotations

from typing import Any

from carillon.fem.model import RIGID_MODES
from solver.coarsening.forest import FOREST
from studies.base.cases import Case, CaseResults

FIRST = RIGID_MODES + 1


class Objectives(CaseResults):
    """The folder of the objectives' study."""

    section = "objectives"

    @property
    def coarsenings(self) -> list[str]:
        """Names of the objectives and the baselines."""
        return [row["coarsening"] for row in self._any["rows"]]

    @property
    def forest(self) -> dict[str, str] | None:
        """Which forests are compared: `forest`, `forest_objective`, `forest_sha256`; or None."""
        return self._any.get("forest")

    @property
    def without_forest(self) -> str:
        """One sentence about why no forests are among the coarsenings; empty if they are."""
        return self._any.get("without_forest", "")

    @property
    def _any(self) -> dict[str, Any]:
        """The first case, for what is the same in all of them."""
        return next(iter(self.ratings.values()))

    def last(self, part: str) -> int:
        """Last mode compared: of the `audible` 7..60, or of `all`; earlier if fewer were wanted."""
        rows = (row for rating in self.ratings.values() for row in rating["rows"])
        return max(row[part]["last"] for row in rows)

    def errors(self, case: Case, coarsening: str) -> dict[str, Any]:
        """Row of a case that belongs to a coarsening."""
        rows: list[dict[str, Any]] = self.ratings[case]["rows"]
        return next(row for row in rows if row["coarsening"] == coarsening)

    def rms(self, case: Case, coarsening: str) -> float:
        """Root mean square of the errors of modes 7..60."""
        return float(self.errors(case, coarsening)["audible"]["rms"])

    def forest_over_fit(self, case: Case) -> float | None:
        """Rms error of the forests over that of the fit they learned; None unless both are here."""
        if self.forest is None or self.forest["forest_objective"] not in self.coarsenings:
            return None
        return self.rms(case, FOREST) / self.rms(case, self.forest["forest_objective"])
