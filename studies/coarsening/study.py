"""What the study is made of."""

from __future__ import annotations

from studies.base.cases import case_files
from studies.base.study import Config, Figure, Study
from workflow.arguments import options, path_word

COARSENING = Study(
    name="coarsening",
    package="studies.coarsening",
    folder="coarsening",
    title="The worst modes of coarse models",
    results="results:CoarseningStudy",
    page="page:page",
    measured=lambda config: case_files(config, "coarsening"),
    beside=lambda config: case_files(config, "coarsening", ".h5"),
    figures=(
        Figure("expected", "plots:expected_figure", "tables/cases.json"),
        Figure("errors", "plots:errors_figure", "tables/cases.json"),
    ),
)


def arguments(config: Config) -> list[str]:
    """How every case is coarsened and refined."""
    part = config["coarsening"]
    how = {
        "forest": part["forest"] and path_word(part["forest"]),
        "modes": part["modes"],
        "refine_to": part["refine_to"],
    }
    return options(how)
