"""All that a run found out about one model, read when asked for."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from solver.files.modes_file import ModesFile, read_modes
from solver.refinement.errors import FROM_SOLID as DISTANCE
from solver.response.response_file import ResponseFile, read_response
from studies.base.conditions import Record
from workflow.report.results import FAST, Run
from workflow.variants import FROM_SOLID, TRUTH

SOLVED, COARSENED = "hcms_ec", FAST
"""Variants that are judged: the solver on the fine mesh, and on the coarsened one."""


@dataclass(frozen=True)
class Evidence(Run):
    """Results of one model of a run."""

    model: str

    @property
    def prefix(self) -> str:
        """What the names of the model's tables begin with."""
        return f"{self.model}-"

    @property
    def settings(self) -> dict[str, Any]:
        """The model's part of the configuration."""
        return self.config["models"][self.model]

    @property
    def tolerances(self) -> dict[str, Any]:
        """Limits by name; None of what is told only."""
        return self.config["validation"]["tolerances"]

    @cached_property
    def shown(self) -> dict[str, ModesFile]:
        """Modes files by variant, without the modes."""
        return {
            variant: read_modes(self.modes_path(self.model, variant), with_modes=False)
            for variant in self.shown_variants(self.model)
        }

    @property
    def distance(self) -> dict[str, Any]:
        """Expected distance of the fine mesh's frequencies from the solid's.

        `rms`, `worst` (with its sign), `worst_mode` and `modes`, the first and last of them; empty
        if it could not be told.
        """
        begin = f"{DISTANCE}_"
        return {
            key.removeprefix(begin): value
            for key, value in self.shown[FROM_SOLID].attributes.items()
            if key.startswith(begin)
        }

    @cached_property
    def compared(self) -> dict[str, dict[str, Any]]:
        """Errors against the truth by shown variant, from `solver compare`."""
        comparisons = self._comparisons["comparisons"]
        return {name: comparisons[name] for name in self.shown if name != TRUTH}

    @cached_property
    def _comparisons(self) -> dict[str, Any]:
        return self.read_json(self.file("comparisons.json"))

    @cached_property
    def audit(self) -> dict[str, Any]:
        """Output of `solver audit`: `spectra` by variant, and `provenance`."""
        return self.read_json(self.file("audit.json"))

    @cached_property
    def response(self) -> ResponseFile:
        """Motion and sound of a strike by shown variant, from `solver respond`."""
        responses = read_response(self.folder / self.file("response.h5"))
        return replace(
            responses, responses={name: responses.responses[name] for name in self.shown}
        )

    @property
    def origins(self) -> dict[str, Record]:
        """Provenance of every file that the page draws on."""
        records = {f"{variant}.h5": spectrum.provenance for variant, spectrum in self.shown.items()}
        records["comparisons.json"] = self._comparisons["provenance"]
        records["audit.json"] = self.audit["provenance"]
        records["response.h5"] = self.response.provenance
        return {self.file(name): record for name, record in records.items()}

    def file(self, name: str) -> str:
        """Name of one of the model's files below the folder of the run."""
        return f"models/{self.model}/{name}"
