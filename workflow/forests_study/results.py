"""Where the study of the forests keeps its results, and how they are read."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import yaml

Row = dict[str, Any]


@dataclass(frozen=True)
class ForestsStudy:
    """The folder of the study; files are read when asked for.

    Attributes
    ----------
    folder
        Folder of the study, below the one that holds the run's `config.yaml`.
    """

    folder: Path

    @cached_property
    def config(self) -> dict[str, Any]:
        """The resolved configuration of the run."""
        loaded: dict[str, Any] = yaml.safe_load((self.folder.parent / "config.yaml").read_text())
        return loaded

    @cached_property
    def model(self) -> dict[str, Any]:
        """Summary of the forests studied, from `forests inspect`."""
        loaded: dict[str, Any] = self._json("model")
        return loaded

    @cached_property
    def blocks(self) -> list[Row]:
        """Output of `forests table`."""
        loaded: list[Row] = self._json("blocks")
        return loaded

    @cached_property
    def benchmark(self) -> dict[str, Any]:
        """Output of `forests benchmark`."""
        loaded: dict[str, Any] = self._json("benchmark")
        return loaded

    @cached_property
    def variants(self) -> list[Row]:
        """Output of `forests variants`."""
        loaded: list[Row] = self._json("variants")
        return loaded

    @cached_property
    def curve(self) -> list[Row]:
        """Output of `forests curve`."""
        loaded: list[Row] = self._json("curve")
        return loaded

    def _json(self, name: str) -> Any:
        return json.loads((self.folder / f"{name}.json").read_text())


def study_beside(config: str | Path) -> ForestsStudy:
    """Study of the run whose resolved configuration is the file `config`."""
    return ForestsStudy(Path(config).parent / "forests_study")
