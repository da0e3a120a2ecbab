"""A study keeps its results in a folder beside the configuration of its run."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import yaml


@dataclass(frozen=True)
class StudyFolder:
    """The folder of a study; files are read when asked for.

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

    def read_json(self, path: str | Path) -> Any:
        """Content of a JSON file, by its path below the folder."""
        return json.loads((self.folder / path).read_text())
