"""What the study has measured, here and on other machines."""

from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from studies.base.conditions import Record
from studies.base.results import Results
from studies.base.table import read_csv_table
from studies.crossover.cases import SolidOnRanks, cases_of
from studies.crossover.config import SECTION
from studies.crossover.methods import METHODS

YES, NO = "yes", "no"
NUMBERS = (
    *("resolution", "unknowns", "modes", "nodes", "ranks", "threads", "latency", "tolerance"),
    *("seconds", "whole_seconds", "processor_seconds", "peak_memory_bytes", "others", "error"),
)
TEXTS = ("machine", "model", "title", "method", "label", "auto", "reference", "reached", "problem")
"""Columns of the runs."""


class Crossover(Results):
    """The folder of the study."""

    section = SECTION

    @cached_property
    def measured(self) -> dict[SolidOnRanks, dict[str, Any]]:
        """Content of the result files by case."""
        return {case: self.read_json(case.path) for case in cases_of(self.config)}

    @property
    def origins(self) -> dict[str, Record]:
        """Provenance of every case."""
        return {case.path: each["provenance"] for case, each in self.measured.items()}

    @cached_property
    def runs(self) -> pd.DataFrame:
        """All runs, one a row, with the columns `NUMBERS`, NaN where one is missing, and `TEXTS`,
        None where one is; those of other machines come last.
        """
        rows = []
        for case, content in self.measured.items():
            about = {
                "machine": self.part["machine"] or content["provenance"]["processor"],
                "model": case.solid,
                "title": self.titles[case.solid],
                "resolution": case.resolution,
                "ranks": case.launch.ranks,
                "nodes": case.launch.nodes,
                "latency": case.launch.latency,
            }
            rows += [{**about, **run, **_texts(run)} for run in content["runs"]]
        for path in self.part["joined"]:
            rows += read_csv_table(Path(path)).rows
        return frame_of(rows)


def frame_of(rows: list[dict[str, Any]]) -> pd.DataFrame:
    """Rows of runs as a frame, see `Crossover.runs`."""
    frame = pd.DataFrame(rows, columns=[*NUMBERS, *TEXTS])
    return frame.astype(dict.fromkeys(NUMBERS, float) | dict.fromkeys(TEXTS, object))


def _texts(run: dict[str, Any]) -> dict[str, str]:
    """What a run is called and whether it is something, in words."""
    flags = {key: run.get(key) for key in ("auto", "reached")}
    return {
        "label": METHODS[run["method"]].label,
        **{key: "" if flag is None else YES if flag else NO for key, flag in flags.items()},
    }
