"""What the study of measured frequencies has found."""

from collections.abc import Mapping
from typing import Any

from studies.base.results import ResultsOfOneFile


class MeasuredStudy(ResultsOfOneFile):
    """The folder of the study."""

    section = "measured"

    @property
    def without(self) -> str:
        """No solid is left out for want of a mesh file."""
        return ""

    @property
    def titles(self) -> dict[str, str]:
        """Names of the solids for people."""
        return {solid["solid"]: solid["title"] for solid in self.measured["solids"]}

    @property
    def rated(self) -> list[dict[str, Any]]:
        """Solids that have models."""
        return [solid for solid in self.measured["solids"] if solid["models"]]

    @property
    def waiting(self) -> list[dict[str, Any]]:
        """Solids of which no model with a mesh can be made yet."""
        return [solid for solid in self.measured["solids"] if solid["left_out"]]


def model_of(solid: Mapping[str, Any], kind: str) -> dict[str, Any] | None:
    """A solid's model of a kind, if it has frequencies."""
    found = (each for each in solid["models"] if each["model"] == kind and "hertz" in each)
    return next(found, None)
