"""What a campaign has found, cell by cell."""

from collections.abc import Mapping
from functools import cached_property
from typing import Any

from studies.base.conditions import Record
from studies.base.results import Results
from studies.campaign.cells import SECTION, Cell, cells_of
from workflow import solids

FAILED, WRONG, MISSED, PASSED = "not run", "wrong", "missed", "passed"
"""Ends of a cell, the worst first."""
ENDS = (FAILED, WRONG, MISSED, PASSED)
SMALLEST = 1e-300
"""Least limit that a share is taken of."""


class Campaign(Results):
    """The folder of the study."""

    section = SECTION

    @cached_property
    def found(self) -> dict[Cell, dict[str, Any]]:
        """Content of the result files by cell, the worst first."""
        every = {cell: self.read_json(f"cells/{cell.path}.json") for cell in cells_of(self.config)}
        return dict(sorted(every.items(), key=lambda pair: badness(pair[1])))

    @property
    def origins(self) -> dict[str, Record]:
        """Provenance of every cell."""
        return {f"cells/{cell.path}.json": each["provenance"] for cell, each in self.found.items()}

    @property
    def solids(self) -> list[str]:
        """Names of the solids that are validated."""
        return solids.named(self.config, f"{SECTION}.models")

    @property
    def passed(self) -> bool:
        """Whether every cell passed."""
        return all(each["passed"] for each in self.found.values())

    @property
    def headline(self) -> str:
        """The verdict in one sentence."""
        ends = [end_of(each) for each in self.found.values()]
        if self.passed:
            return f"Passed: all {len(ends)} cells."
        counts = [f"{ends.count(end)} {end}" for end in ENDS[:-1] if end in ends]
        return (
            f"Failed: {len(ends) - ends.count(PASSED)} of {len(ends)} cells ({', '.join(counts)})."
        )

    def label(self, cell: Cell) -> str:
        """A cell in a few words."""
        ranks = f"{cell.ranks} rank{'s' if cell.ranks > 1 else ''}"
        return f"{self.titles[cell.solid]}, {cell.material}, seed {cell.seed}, {ranks}"


def end_of(result: Mapping[str, Any]) -> str:
    """How a cell ended, one of `ENDS`."""
    if result["passed"]:
        return PASSED
    if result["reason"] is not None:
        return FAILED
    return WRONG if result["wrong"] else MISSED


def share_of(criterion: Mapping[str, Any]) -> float:
    """What a criterion found as a share of its limit; infinite for what is missed by a count."""
    value, limit = criterion["found"], criterion["limit"]
    if value is None:
        return float("inf")
    if criterion["key"] in ("rigid", "counted"):
        return 0.0 if value == limit else float("inf")
    return float(value / max(limit, SMALLEST))


def nearest(result: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """The criterion that is missed by most, or comes nearest to its limit; None without any."""
    return max(result["criteria"], key=share_of, default=None)


def badness(result: Mapping[str, Any]) -> tuple[int, float]:
    """What cells are put in order by, the worst first."""
    worst = nearest(result)
    return ENDS.index(end_of(result)), -(share_of(worst) if worst else 0.0)
