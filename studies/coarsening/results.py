"""What the study of the worst modes has found."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from studies.base.cases import Case, CaseResults

MODELS = ("plain", "refined")
"""The coarse model as it is, and with blocks that stay fine."""

SWAP = "swap"
"""Verdict on a mode with which nothing is wrong but its number."""

Mode = dict[str, Any]


class CoarseningStudy(CaseResults):
    """The folder of the study."""

    section = "coarsening"

    @property
    def goals(self) -> dict[str, float]:
        """Limits of `rms` and `worst` error, and from where on a mode is `far_off`."""
        return self.first["goals"]

    @property
    def last(self) -> int:
        """Last mode rated; earlier in cases that have fewer."""
        return max(int(self.errors(case, "plain")["last"]) for case in self.ratings)

    def errors(self, case: Case, model: str, kind: str = "by_index") -> dict[str, Any]:
        """Summary of the errors of a model `by_index`, `recognised` or `expected`."""
        return self.ratings[case][model][kind]

    def meets_goals(self, case: Case, model: str) -> bool:
        """Whether the true errors are within both limits."""
        errors = self.errors(case, model)
        within = errors["rms"] <= self.goals["rms"]
        return bool(within and abs(errors["worst"]) <= self.goals["worst"])

    def far_off(self, model: str) -> Iterator[tuple[Case, Mode]]:
        """Modes of all cases that are far off in a model."""
        for case, rating in self.ratings.items():
            for mode in rating[model]["far_off"]:
                yield case, mode

    def worst_of(self, solid: str) -> tuple[Case, Mode] | None:
        """The worst mode of the plain models of a solid, of which there is a picture."""
        modes = [(case, mode) for case, mode in self.far_off("plain") if case.solid == solid]
        return max(modes, key=lambda pair: _badness(pair[1]), default=None)

    def pictures_of(self, case: Case) -> Path:
        """File with the pictures of a case."""
        return (self.folder / "cases" / case.path).with_suffix(".h5")


def _badness(mode: Mode) -> tuple[bool, float]:
    return mode["verdict"] != SWAP, abs(mode["error"])
