"""What the study is made of."""

from pathlib import Path
from typing import Any

from studies.base.study import Config, Figure, Study
from studies.crossover.cases import cases_of
from studies.crossover.config import SECTION


def measured_files(config: Config) -> list[str]:
    """Results of all cases, and the tables of other machines, which lie elsewhere."""
    joined = [str(Path(path).absolute()) for path in config[SECTION]["joined"]]
    return [*(case.path for case in cases_of(config)), *joined]


def measured_part(config: Config) -> dict[str, Any]:
    """What of the configuration a measurement depends on, beside solid and launch."""
    names = ("modes", "tolerances", "methods", "seconds", "runs", "most_unknowns")
    return {name: config[SECTION][name] for name in names}


CROSSOVER = Study(
    name=SECTION,
    title="The fastest method by unknowns, modes, ranks and tolerance",
    results="results:Crossover",
    tables=("fastest", "methods", "runs", "provenance"),
    measured=measured_files,
    figures=(
        Figure("seconds", "plots:seconds_figure", "tables/runs.json"),
        Figure("memory", "plots:memory_figure", "tables/runs.json"),
    ),
)
