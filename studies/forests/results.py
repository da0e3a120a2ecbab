"""Where the study of the forests keeps its results."""

from functools import cached_property
from typing import Any

from studies.base.conditions import Record
from studies.base.results import Results

MEASUREMENTS = ("blocks", "benchmark", "variants", "curve")
"""Names of the files of `forests table`, `benchmark`, `variants` and `curve`."""


class ForestsStudy(Results):
    """The folder of the study of the forests."""

    @cached_property
    def model(self) -> dict[str, Any]:
        """Summary of the forests studied, from `forests inspect`."""
        return self.read_json("model.json")

    @property
    def on_blocks(self) -> dict[str, Any]:
        """Output of `forests table`."""
        return self.read_json("blocks.json")

    @cached_property
    def benchmark(self) -> dict[str, Any]:
        """Times of the forests, from `forests benchmark`."""
        return self.result("benchmark")

    def result(self, name: str) -> Any:
        """Numbers of a measurement."""
        return self.read_json(f"{name}.json")["result"]

    def record(self, name: str) -> Record:
        """Provenance of a measurement."""
        return self.read_json(f"{name}.json")["provenance"]

    @property
    def origins(self) -> dict[str, Record]:
        """Provenance of the forests and of the measurements."""
        measured = {f"forests_study/{name}.json": self.record(name) for name in MEASUREMENTS}
        return {self.model["path"]: self.model["provenance"], **measured}
