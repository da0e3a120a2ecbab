"""Where the study of the forests keeps its results, and how they are read."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any

from workflow.study_folder import StudyFolder

Row = dict[str, Any]


class ForestsStudy(StudyFolder):
    """The folder of the study of the forests."""

    @cached_property
    def model(self) -> dict[str, Any]:
        """Summary of the forests studied, from `forests inspect`."""
        loaded: dict[str, Any] = self.read_json("model.json")
        return loaded

    @cached_property
    def blocks(self) -> list[Row]:
        """Output of `forests table`."""
        loaded: list[Row] = self.read_json("blocks.json")
        return loaded

    @cached_property
    def benchmark(self) -> dict[str, Any]:
        """Output of `forests benchmark`."""
        loaded: dict[str, Any] = self.read_json("benchmark.json")
        return loaded

    @cached_property
    def variants(self) -> list[Row]:
        """Output of `forests variants`."""
        loaded: list[Row] = self.read_json("variants.json")
        return loaded

    @cached_property
    def curve(self) -> list[Row]:
        """Output of `forests curve`."""
        loaded: list[Row] = self.read_json("curve.json")
        return loaded


def study_beside(config: str | Path) -> ForestsStudy:
    """Study of the run whose resolved configuration is the file `config`."""
    return ForestsStudy(Path(config).parent / "forests_study")
