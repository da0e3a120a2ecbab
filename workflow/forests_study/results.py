"""Where the study of the forests keeps its results, and how they are read."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any

from workflow.study_folder import StudyFolder

Row = dict[str, Any]

MEASUREMENTS = ("blocks", "benchmark", "variants", "curve")
"""Names of the files of `forests table`, `benchmark`, `variants` and `curve`."""


class ForestsStudy(StudyFolder):
    """The folder of the study of the forests."""

    @cached_property
    def model(self) -> dict[str, Any]:
        """Summary of the forests studied, from `forests inspect`."""
        loaded: dict[str, Any] = self.read_json("model.json")
        return loaded

    @cached_property
    def found(self) -> dict[str, Row]:
        """Files of the measurements, each with `result` and `provenance`, by name."""
        return {name: self.read_json(f"{name}.json") for name in MEASUREMENTS}

    @property
    def blocks(self) -> list[Row]:
        """Rows of `forests table`."""
        rows: list[Row] = self.found["blocks"]["result"]
        return rows

    @property
    def benchmark(self) -> dict[str, Any]:
        """Output of `forests benchmark`."""
        result: dict[str, Any] = self.found["benchmark"]["result"]
        return result

    @property
    def variants(self) -> list[Row]:
        """Rows of `forests variants`."""
        rows: list[Row] = self.found["variants"]["result"]
        return rows

    @property
    def curve(self) -> list[Row]:
        """Rows of `forests curve`."""
        rows: list[Row] = self.found["curve"]["result"]
        return rows

    def record(self, name: str) -> dict[str, Any]:
        """Provenance of a measurement."""
        record: dict[str, Any] = self.found[name]["provenance"]
        return record


def study_beside(config: str | Path) -> ForestsStudy:
    """Study of the run whose resolved configuration is the file `config`."""
    return ForestsStudy(Path(config).parent / "forests_study")
