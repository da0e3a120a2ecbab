"""Results of the scenes, read when asked for."""

import csv
import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from studies.base.results import Results
from studies.scenes.examples import FOLDER, OUTPUTS, TOLD, SceneExample, scenes

SECONDS = "s"
"""Column of Snakemake's benchmarks that holds the wall time."""


@dataclass(frozen=True)
class PlayedScene:
    """A scene that was played."""

    example: SceneExample
    """What it is."""
    folder: Path
    """Its files."""
    benchmark: Path
    """File in which Snakemake keeps how long it took; it may be absent."""

    @property
    def names(self) -> dict[str, str]:
        """What tables call it."""
        return {"scene": self.example.name, "title": self.example.title}

    @cached_property
    def told(self) -> dict[str, Any]:
        """What the command told."""
        return json.loads((self.folder / TOLD).read_text())

    @property
    def wall_seconds(self) -> float:
        """Wall time of all, films and pages included where Snakemake measured it [s]."""
        if not self.benchmark.is_file():
            return float(sum(self.told["timings"].values()))
        with self.benchmark.open(newline="") as file:
            return float(next(csv.DictReader(file, delimiter="\t"))[SECONDS])

    @property
    def impacts(self) -> list[dict[str, str]]:
        """Lines of the list of impacts, in the order of time."""
        with (self.folder / OUTPUTS["impacts"]).open(newline="", encoding="utf-8") as file:
            return list(csv.DictReader(file))

    @property
    def sizes(self) -> dict[str, int]:
        """Bytes of its files by what they are."""
        return {key: (self.folder / name).stat().st_size for key, name in OUTPUTS.items()}


@dataclass(frozen=True)
class Scenes(Results):
    """The folder of all scenes."""

    @cached_property
    def scenes(self) -> list[PlayedScene]:
        """Those that the configuration asks for."""
        benchmarks = self.folder.parent / "benchmarks" / FOLDER
        return [
            PlayedScene(scene, self.folder / name, benchmarks / f"{name}.tsv")
            for name, scene in scenes(self.config).items()
        ]
