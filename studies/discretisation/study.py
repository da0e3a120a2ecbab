"""What the study is made of."""

from __future__ import annotations

from studies.base.cases import CaseStudy
from studies.base.study import Config, Figure
from workflow.arguments import options, path_word


def arguments(config: Config) -> list[str]:
    """What is compared in every case, and how often it is timed."""
    part = config["discretisation"]
    forest = part["forest"] and path_word(part["forest"])
    return options({"forest": forest, "modes": part["modes"], "runs": part["runs"]})


DISCRETISATION = CaseStudy(
    name="discretisation",
    title="Voxels, coarse elements and finite cells",
    results="results:DiscretisationStudy",
    tables=("summary", "cases", "truths", "provenance"),
    arguments=arguments,
    timed=True,
    figures=(
        Figure("unknowns", "plots:unknowns_figure", "tables/cases.json"),
        Figure("seconds", "plots:seconds_figure", "tables/cases.json"),
    ),
)
