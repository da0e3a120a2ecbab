"""Where a study keeps its results, and how they are read."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import yaml
from markupsafe import Markup

from studies.base.conditions import Record
from studies.base.parts import inline
from studies.base.table import Table, read_table
from workflow import pinned_meshes, solids


@dataclass(frozen=True)
class Results:
    """The folder of a study; files are read when asked for."""

    folder: Path
    """It, or the one above, holds the run's `config.yaml`."""
    section: ClassVar[str] = ""
    """Of the configuration that holds the study's `models`; all of it if empty."""
    measures: ClassVar[Mapping[str, str]] = {}
    """Where the configuration names the solids that the study measures, by the file of the result:
    methods, convergence, scaling."""

    @cached_property
    def config(self) -> dict[str, Any]:
        """The resolved configuration of the run."""
        places = (folder / "config.yaml" for folder in (self.folder, self.folder.parent))
        return yaml.safe_load(next(filter(Path.exists, places)).read_text())

    @property
    def part(self) -> dict[str, Any]:
        """The study's own part of the configuration."""
        return self.config[self.section] if self.section else self.config

    @property
    def without(self) -> str:
        """What is said of solids that are left out, and of meshes that are not the pinned ones."""
        if self.section not in solids.studied(self.config):
            return ""
        others = pinned_meshes.of_study(self.config, self.section)
        return " ".join(filter(None, [solids.without(self.config, self.section), *others]))

    @property
    def titles(self) -> dict[str, str]:
        """Names of the solids for people."""
        models = self.part["models"]
        return {name: models[name]["title"] or spelt(name) for name in models}

    def read_json(self, path: str | Path) -> Any:
        """Content of a JSON file, by its path below the folder."""
        return json.loads((self.folder / path).read_text())

    @cached_property
    def methods(self) -> dict[str, Any]:
        """Output of `solver benchmark` for the solids that have one."""
        return self._measured("methods")

    @cached_property
    def convergence(self) -> dict[str, Any]:
        """Output of `solver convergence` for the solids that have one."""
        return self._measured("convergence")

    @cached_property
    def scaling(self) -> dict[str, Any]:
        """Output of `solver scaling` for the solids that have one."""
        return self._measured("scaling")

    def _measured(self, file: str) -> dict[str, Any]:
        names = solids.named(self.config, self.measures[file])
        return {name: self.read_json(f"models/{name}/{file}.json") for name in names}

    @property
    def origins(self) -> dict[str, Record]:
        """Provenance of the result files by name."""
        return {
            f"models/{name}/{file}.json": output["provenance"]
            for file in self.measures
            for name, output in getattr(self, file).items()
        }

    def table(self, name: str) -> Table:
        """A table that was written before."""
        return read_table(self.folder / "tables" / f"{name}.json")

    def figure(self, name: str) -> Path:
        """A figure, by file name."""
        return self.folder / "figures" / name

    def drawn(self, name: str) -> Markup:
        """A figure as part of a page, by file name without ending."""
        return inline(self.figure(f"{name}.svg"))


def spelt(name: str) -> str:
    """A name with hyphens as the beginning of a sentence."""
    return name.replace("-", " ").capitalize()


class ResultsOfOneFile(Results):
    """The folder of a study whose measurements are all in one file, named by its section."""

    @property
    def file(self) -> str:
        """Name of that file."""
        return f"{self.section}.json"

    @cached_property
    def measured(self) -> dict[str, Any]:
        """Output of the study's command."""
        return self.read_json(self.file)

    @property
    def origins(self) -> dict[str, Record]:
        """Provenance of the measurement."""
        return {self.file: self.measured["provenance"]}
