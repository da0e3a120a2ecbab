"""What the study is made of."""

from __future__ import annotations

from dataset_gen import objectives
from studies.base.cases import case_files
from studies.base.study import Config, Figure, Study
from workflow.arguments import options, path_word

OBJECTIVES = Study(
    name="objectives",
    package="studies.objectives",
    folder="objectives",
    title="Objectives of the coarsening",
    results="results:Objectives",
    page="page:page",
    measured=lambda config: case_files(config, "objectives"),
    figures=(
        Figure("{solid}", "plots:errors_figure", "tables/errors.json", of="objectives.models"),
    ),
)


def arguments(config: Config) -> list[str]:
    """What is compared in every case."""
    part = config["objectives"]
    how = {
        "forest": part["forest"] and path_word(part["forest"]),
        "modes": part["modes"],
        "objectives": ",".join(part["objectives"] or objectives.OBJECTIVES),
    }
    return options(how)
