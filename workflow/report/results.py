"""Where a run keeps its results, and how they are read."""

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

from carillon.drawing.solid import Skin
from carillon.fem.model import Solid
from solver.files.modes_file import CHECKS, FINE_TAKEN, ModesFile, read_modes
from studies.base.conditions import Record
from studies.base.results import Results
from studies.base.skins import skin_of
from workflow import settings
from workflow.composition import surface_of
from workflow.report.study import MEASURES
from workflow.variants import candidates_of, further_of, shown_of, variants_of

FAST = "ddfem_hcms_ec"
"""The coarsened variant that is listed."""
PRECOMPUTATION = ("mesh", "material")
"""Phases that come before any method: they are needed once for a solid."""


class Run(Results):
    """The folder of a run."""

    measures = MEASURES

    @property
    def models(self) -> list[str]:
        """Names of the models in the order of the configuration."""
        return list(self.config["models"])

    def drawn_variants(self, model: str) -> tuple[str, ...]:
        """Variants of a model that are drawn."""
        return shown_of(self.config["models"][model])

    def shown_variants(self, model: str) -> tuple[str, ...]:
        """Drawn variants without the coarse model, if the fine solid was solved in its place."""
        drawn = self.drawn_variants(model)
        return drawn if self.fine_taken(model) is None else tuple(n for n in drawn if n != FAST)

    def fine_taken(self, model: str) -> str | None:
        """Why a model was solved without being coarsened; None if it was, or cannot be."""
        if FAST not in self.drawn_variants(model):
            return None
        if model not in self._fine_taken:
            file = read_modes(self.modes_path(model, FAST), with_modes=False)
            self._fine_taken[model] = file.attributes.get(FINE_TAKEN)
        return self._fine_taken[model]

    @cached_property
    def _fine_taken(self) -> dict[str, str | None]:
        return {}

    def skin(self, model: str, solid: Solid) -> Skin | None:
        """The surface that a model is drawn as if it is of finite cells; None of voxels."""
        part = self.config["models"][model]
        if part["discretisation"] == "voxel":
            return None
        return skin_of(solid, surface_of(self.config, model))

    def modes_path(self, model: str, variant: str) -> Path:
        """Modes file of a model and variant."""
        return self.folder / "models" / model / f"{variant}.h5"

    @cached_property
    def spectra(self) -> dict[str, dict[str, ModesFile]]:
        """Modes files without the modes themselves, by model and variant."""
        return {
            model: {
                variant: read_modes(self.modes_path(model, variant), with_modes=False)
                for variant in variants_of(self.config["models"][model])
            }
            for model in self.models
        }

    @property
    def solved(self) -> Iterator[tuple[str, str, ModesFile]]:
        """All modes files, each after its model and variant."""
        for model, spectra in self.spectra.items():
            for variant, spectrum in spectra.items():
                yield model, variant, spectrum

    @cached_property
    def comparisons(self) -> dict[str, dict[str, Any]]:
        """Output of `solver compare` against the truth, by model and variant."""
        return {model: self._compared(model) for model in self.models}

    def _compared(self, model: str) -> dict[str, Any]:
        part = self.config["models"][model]
        names = ["comparisons", *(["further_comparisons"] if further_of(part) else [])]
        files = [self.read_json(f"models/{model}/{name}.json") for name in names]
        comparisons = {name: each for file in files for name, each in file["comparisons"].items()}
        return {name: comparisons[name] for name in candidates_of(part)}

    @cached_property
    def shards(self) -> dict[str, dict[str, Any]]:
        """Summaries of the training data by shard."""
        names = settings.own_shards(self.config)
        return {name: self.read_json(f"dataset/{name}.json") for name in names}

    @cached_property
    def forests(self) -> dict[str, Any]:
        """Summary of the forests."""
        return self.read_json("forests/forests.json")

    @cached_property
    def on_blocks(self) -> dict[str, Any]:
        """Output of `forests table`: how the coarsenings do on single blocks."""
        return self.read_json("forests/table.json")

    @property
    def origins(self) -> dict[str, Record]:
        """Provenance of the result files by name."""
        origins = {f"dataset/{name}.h5": each["provenance"] for name, each in self.shards.items()}
        forests = self.config["forests"]["model"] or "forests/forests.h5"
        origins[forests] = self.forests["provenance"]
        origins["forests/table.json"] = self.on_blocks["provenance"]
        for model, spectra in self.spectra.items():
            place = f"models/{model}/"
            origins |= {f"{place}{name}.h5": file.provenance for name, file in spectra.items()}
            measured = super().origins.items()
            origins |= {file: record for file, record in measured if file.startswith(place)}
        return origins


def records(run: Run) -> dict[str, Record]:
    """Provenance of all modes files."""
    return {f"{model} {variant}": spectrum.provenance for model, variant, spectrum in run.solved}


def solve_seconds(spectrum: ModesFile) -> float:
    """Wall time [s] from meshed solid and moduli to modes, coarsening included."""
    outside = (*PRECOMPUTATION, *CHECKS)
    timings: dict[str, float] = spectrum.attributes["timings"]
    return sum(seconds for phase, seconds in timings.items() if phase not in outside)


def precomputation_seconds(spectrum: ModesFile) -> float:
    """Wall time [s] of voxels and material."""
    return sum(spectrum.attributes["timings"].get(phase, 0.0) for phase in PRECOMPUTATION)
