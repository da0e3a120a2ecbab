"""What the study of discretisations has found."""

from typing import Any

from studies.base.cases import Case, CaseResults


class DiscretisationStudy(CaseResults):
    """The folder of the study."""

    section = "discretisation"

    @property
    def last(self) -> int:
        """Last mode rated."""
        return int(self.part["modes"])

    @property
    def runs(self) -> int:
        """Runs of which every time is the median."""
        return int(self.part["runs"])

    def ways_of(self, case: Case) -> list[str]:
        """Names of the ways to the spectrum of a case."""
        return list(self.ratings[case]["ways"])

    def way(self, case: Case, name: str) -> dict[str, Any]:
        """What a way to the spectrum of a case came to."""
        return self.ratings[case]["ways"][name]
