"""Where a run keeps its results, and how they are read."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import yaml

from solver.files.modes_file import ModesFile, read_modes
from workflow import settings
from workflow.variants import CANDIDATES, VARIANTS


@dataclass(frozen=True)
class Results:
    """The folder of a run; files are read when asked for.

    Attributes
    ----------
    folder
        Folder that holds `config.yaml`.
    """

    folder: Path

    @cached_property
    def config(self) -> dict[str, Any]:
        """The resolved configuration."""
        loaded: dict[str, Any] = yaml.safe_load((self.folder / "config.yaml").read_text())
        return loaded

    @property
    def models(self) -> list[str]:
        """Names of the models in the order of the configuration."""
        return list(self.config["models"])

    def title(self, model: str) -> str:
        """Name of a model for people."""
        own: str = self.config["models"][model]["title"]
        return own or model.replace("-", " ").capitalize()

    def modes_path(self, model: str, variant: str) -> Path:
        """Modes file of a model and variant."""
        return self.folder / "models" / model / f"{variant}.h5"

    def figure(self, name: str) -> Path:
        """A figure, by file name."""
        return self.folder / "figures" / name

    @cached_property
    def spectra(self) -> dict[str, dict[str, ModesFile]]:
        """Modes files without the modes themselves, by model and variant."""
        return {
            model: {
                variant: read_modes(self.modes_path(model, variant), with_modes=False)
                for variant in VARIANTS
            }
            for model in self.models
        }

    @cached_property
    def comparisons(self) -> dict[str, dict[str, dict[str, Any]]]:
        """Output of `solver compare` against the truth, by model and variant."""
        return {
            model: {
                variant: self._json("models", model, f"{variant}.comparison.json")
                for variant in CANDIDATES
            }
            for model in self.models
        }

    @cached_property
    def convergence(self) -> dict[str, dict[str, Any]]:
        """Output of `solver convergence` for the models that have one."""
        return {
            model: self._json("models", model, "convergence.json")
            for model in self.config["convergence"]["models"]
        }

    @cached_property
    def methods(self) -> dict[str, dict[str, Any]]:
        """Output of `solver benchmark` for the models that have one."""
        return {
            model: self._json("models", model, "methods.json")
            for model in self.config["times"]["models"]
        }

    @property
    def titles(self) -> dict[str, str]:
        """Names of the models for people."""
        return {model: self.title(model) for model in self.models}

    @cached_property
    def shards(self) -> dict[str, dict[str, Any]]:
        """Summaries of the training data by shard."""
        names = settings.own_shards(self.config)
        return {name: self._json("dataset", f"{name}.json") for name in names}

    @cached_property
    def forests(self) -> dict[str, Any]:
        """Summary of the forests."""
        loaded: dict[str, Any] = self._json("forests", "forests.json")
        return loaded

    @cached_property
    def blocks(self) -> list[dict[str, Any]]:
        """Rows of `forests table`: how the coarsenings do on single blocks."""
        loaded: list[dict[str, Any]] = self._blocks_file["result"]
        return loaded

    @property
    def blocks_record(self) -> dict[str, Any]:
        """Provenance of `forests table`."""
        loaded: dict[str, Any] = self._blocks_file["provenance"]
        return loaded

    @cached_property
    def _blocks_file(self) -> Any:
        return self._json("forests", "table.json")

    @cached_property
    def scaling(self) -> dict[str, dict[str, Any]]:
        """Output of `solver scaling` for the models that have one."""
        return {
            model: self._json("models", model, "scaling.json")
            for model in self.config["scaling"]["models"]
        }

    def _json(self, *parts: str) -> Any:
        return json.loads(self.folder.joinpath(*parts).read_text())


def results_beside(config: str | Path) -> Results:
    """Results of the run whose resolved configuration is the file `config`."""
    return Results(Path(config).parent)
