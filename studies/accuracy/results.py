"""What the study of the discretisations has found."""

from functools import cached_property
from typing import Any

from studies.base.conditions import Record
from studies.base.results import Results

FILE = "accuracy.json"


class AccuracyStudy(Results):
    """The folder of the study."""

    section = "accuracy"

    @cached_property
    def measured(self) -> dict[str, Any]:
        """Output of `solver accuracy`."""
        return self.read_json(FILE)

    @property
    def origins(self) -> dict[str, Record]:
        """Provenance of the measurement."""
        return {FILE: self.measured["provenance"]}

    @property
    def without(self) -> str:
        """One sentence if tetrahedra are left out; empty if not."""
        return str(self.measured["without"])

    @property
    def titles(self) -> dict[str, str]:
        """Names of the solids for people."""
        return {name: each["title"] for name, each in self.measured["references"].items()}

    @property
    def discretisations(self) -> list[str]:
        """Names of all that are compared, in their order."""
        return list(dict.fromkeys(level["discretisation"] for level in self.measured["levels"]))

    def levels(self, solid: str, discretisation: str) -> list[dict[str, Any]]:
        """Models that have a spectrum, coarsest first."""
        return [
            level
            for level in self.measured["levels"]
            if (level["solid"], level["discretisation"]) == (solid, discretisation)
            and "rms" in level
        ]
