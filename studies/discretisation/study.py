"""What the study is made of."""

from __future__ import annotations

from studies.base.cases import case_files
from studies.base.study import Config, Figure, Study
from workflow.arguments import options, path_word

DISCRETISATION = Study(
    name="discretisation",
    package="studies.discretisation",
    folder="discretisation",
    title="Voxels, coarse elements and finite cells",
    results="results:DiscretisationStudy",
    page="page:page",
    measured=lambda config: case_files(config, "discretisation"),
    figures=(
        Figure("unknowns", "plots:unknowns_figure", "tables/cases.json"),
        Figure("seconds", "plots:seconds_figure", "tables/cases.json"),
    ),
)


def arguments(config: Config) -> list[str]:
    """What is compared in every case, and how often it is timed."""
    part = config["discretisation"]
    how = {
        "forest": part["forest"] and path_word(part["forest"]),
        "modes": part["modes"],
        "runs": part["runs"],
    }
    return options(how)
