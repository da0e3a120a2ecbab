"""Where the results for the figures are kept."""

from __future__ import annotations

from functools import cached_property
from typing import Any

from workflow import solids
from workflow.studies.base.results import Results


class Figures(Results):
    """The folder of the figures; solids whose mesh does not exist are left out."""

    section = ("figures",)

    @property
    def without(self) -> str:
        """One sentence about the solids that are left out; empty if there are none."""
        return solids.without(self.config, "figures")

    @cached_property
    def methods(self) -> dict[str, Any]:
        """Output of `solver benchmark` by solid."""
        return self._read("methods", "models")

    @cached_property
    def convergence(self) -> dict[str, Any]:
        """Output of `solver convergence` by solid."""
        return self._read("convergence", "convergence")

    @cached_property
    def scaling(self) -> dict[str, Any]:
        """Output of `solver scaling` by solid."""
        return self._read("scaling", "scaling")

    def _read(self, file: str, part: str) -> dict[str, Any]:
        return self.by_model(f"{file}.json", solids.named(self.config, f"figures.{part}"))
