"""What the study of the discretisations has found."""

from typing import Any

from studies.base.results import ResultsOfOneFile


class LevelsOfSolids(ResultsOfOneFile):
    """Results with models of several sizes of each solid, tetrahedra among them."""

    @property
    def without(self) -> str:
        """One sentence if tetrahedra are left out; empty if not."""
        return str(self.measured["without"])

    def levels(self, solid: str, discretisation: str) -> list[dict[str, Any]]:
        """Models that have a spectrum, coarsest first."""
        return [
            level
            for level in self.measured["levels"]
            if (level["solid"], level["discretisation"]) == (solid, discretisation)
            and "rms" in level
        ]


class AccuracyStudy(LevelsOfSolids):
    """The folder of the study."""

    section = "accuracy"

    @property
    def titles(self) -> dict[str, str]:
        """Names of the solids for people."""
        return {name: each["title"] for name, each in self.measured["references"].items()}

    @property
    def discretisations(self) -> list[str]:
        """Names of all that are compared, in their order."""
        return list(dict.fromkeys(level["discretisation"] for level in self.measured["levels"]))
