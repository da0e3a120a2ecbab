"""What the study of thin walls has found."""

from functools import cached_property
from typing import Any

from studies.accuracy.results import LevelsOfSolids
from studies.base.conditions import Record
from studies.thin_walls.bounds import is_too_low

BOUNDS = "bounds.json"


class ThinWallStudy(LevelsOfSolids):
    """The folder of the study."""

    section = "thin_walls"

    @property
    def titles(self) -> dict[str, str]:
        """Names of the solids for people."""
        return dict(self.measured["titles"])

    @cached_property
    def bounds(self) -> dict[str, Any]:
        """Lowest ratios to the references over lattices."""
        return self.read_json(BOUNDS)

    @property
    def origins(self) -> dict[str, Record]:
        """Provenance of both measurements."""
        return super().origins | {BOUNDS: self.bounds["provenance"]}

    def of_kind(self, *kinds: str) -> list[dict[str, Any]]:
        """Solids of these kinds in their positions, with their `title`, `wall` and `verdict`."""
        measured = self.measured
        return [
            {
                **found,
                "title": self.titles[found["solid"]],
                "wall": measured["walls"][found["solid"]],
                "verdict": self._verdict(found),
            }
            for found in measured["solids"]
            if measured["kinds"][found["solid"]] in kinds
        ]

    @property
    def over_size(self) -> list[str]:
        """Names of the solids of which there are several sizes."""
        return list(dict.fromkeys(level["solid"] for level in self.measured["levels"]))

    def lowest(self, solid: str) -> dict[str, Any]:
        """The lattice on which a frequency of the solid is the lowest, and how many there are."""
        lattices = [each for each in self.bounds["lattices"] if each["solid"] == solid]
        rated = [each for each in lattices if "lowest" in each]
        count = {"lattices": len(lattices), "rated": len(rated)}
        if not rated:
            return {**count, "verdict": "no model", "problem": lattices[0]["problem"]}
        found = min(rated, key=lambda each: each["lowest"])
        low = is_too_low(found, self.bounds["doubts"])
        return {**count, **found, "verdict": "too low" if low else "none too low"}

    def _verdict(self, found: dict[str, Any]) -> str:
        """Which of the aims are met."""
        if "problem" in found:
            return "no model"
        if "rms" not in found:
            return "no reference"
        rms, worst = self.measured["aims"][self.measured["kinds"][found["solid"]]]
        missed = [
            name
            for name, is_missed in (
                ("rms", found["rms"] > rms),
                ("worst", abs(found["worst"]) > worst),
                ("unknowns", found["unknowns"] > self.measured["most_unknowns"]),
            )
            if is_missed
        ]
        return f"missed: {', '.join(missed)}" if missed else "met"
