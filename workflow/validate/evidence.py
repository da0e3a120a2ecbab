"""All that a run found out about one model, read when asked for."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from solver.files.modes_file import ModesFile, read_modes
from solver.response.response_file import ResponseFile, read_response
from workflow.report.results import Results
from workflow.variants import SHOWN, TRUTH

SOLVED, COARSENED = "hcms_ec", "ddfem_hcms_ec"
"""Variants that are judged: the solver on the fine mesh, and on the coarsened one."""
COMPARED = tuple(variant for variant in SHOWN if variant != TRUTH)


@dataclass(frozen=True)
class Evidence:
    """Results of one model.

    Attributes
    ----------
    results, model : the run, and the model's name in its configuration.
    """

    results: Results
    model: str

    @property
    def settings(self) -> dict[str, Any]:
        """The model's part of the configuration."""
        part: dict[str, Any] = self.results.config["models"][self.model]
        return part

    @property
    def tolerances(self) -> dict[str, float]:
        """Limits by name."""
        part: dict[str, float] = self.results.config["validation"]["tolerances"]
        return part

    @cached_property
    def spectra(self) -> dict[str, ModesFile]:
        """Modes files by variant, without the modes."""
        return {
            variant: read_modes(self.results.modes_path(self.model, variant), with_modes=False)
            for variant in SHOWN
        }

    @cached_property
    def comparisons(self) -> dict[str, dict[str, Any]]:
        """Output of `solver compare` against the truth by variant."""
        return {variant: self._json(f"{variant}.comparison.json") for variant in COMPARED}

    @property
    def audits(self) -> dict[str, dict[str, Any]]:
        """Output of `solver audit` by variant."""
        spectra: dict[str, dict[str, Any]] = self._audit_file["spectra"]
        return spectra

    @property
    def audit_record(self) -> dict[str, Any]:
        """Provenance of the audits."""
        record: dict[str, Any] = self._audit_file["provenance"]
        return record

    @cached_property
    def response(self) -> ResponseFile:
        """Output of `solver respond`."""
        return read_response(self.results.folder / "models" / self.model / "response.h5")

    @cached_property
    def mode_pictures(self) -> dict[str, dict[str, Any]]:
        """Frequency and likeness of the first elastic mode by variant."""
        path = self.results.figure(f"{self.model}-mode.json")
        loaded: dict[str, dict[str, Any]] = json.loads(path.read_text())
        return loaded

    def file(self, name: str) -> str:
        """Name of one of the model's files below the folder of the run."""
        return f"models/{self.model}/{name}"

    @cached_property
    def _audit_file(self) -> dict[str, Any]:
        return self._json("audit.json")

    def _json(self, name: str) -> dict[str, Any]:
        loaded: dict[str, Any] = json.loads((self.results.folder / self.file(name)).read_text())
        return loaded
