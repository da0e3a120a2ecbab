"""What the study of the objectives has found."""

from typing import Any

from solver.coarsening.forest import FOREST
from studies.base.cases import Case, CaseResults


class Objectives(CaseResults):
    """The folder of the objectives' study."""

    section = "objectives"

    @property
    def coarsenings(self) -> list[str]:
        """Names of the objectives and the baselines."""
        return [row["coarsening"] for row in self.first["rows"]]

    @property
    def forest(self) -> dict[str, str] | None:
        """Which forests are compared: `forest`, `forest_objective`, `forest_sha256`; or None."""
        return self.first.get("forest")

    @property
    def without_forest(self) -> str:
        """One sentence about why no forests are among the coarsenings; empty if they are."""
        return self.first.get("without_forest", "")

    @property
    def last(self) -> dict[str, int]:
        """Last mode compared: of the `audible` 7..60, and of `all`; or fewer."""
        rows = [row for rating in self.ratings.values() for row in rating["rows"]]
        return {part: max(row[part]["last"] for row in rows) for part in ("audible", "all")}

    def errors(self, case: Case, coarsening: str) -> dict[str, Any]:
        """Row of a case that belongs to a coarsening."""
        return next(r for r in self.ratings[case]["rows"] if r["coarsening"] == coarsening)

    def rms(self, case: Case, coarsening: str) -> float:
        """Root mean square of the errors of modes 7..60."""
        return float(self.errors(case, coarsening)["audible"]["rms"])

    def forest_over_fit(self, case: Case) -> float | None:
        """Rms error of the forests over that of the fit they learned; None unless both are here."""
        if self.forest is None or self.forest["forest_objective"] not in self.coarsenings:
            return None
        return self.rms(case, FOREST) / self.rms(case, self.forest["forest_objective"])
