"""What the study is made of."""

from __future__ import annotations

from studies.base.cases import CaseStudy
from studies.base.study import Config, Figure
from workflow.arguments import options, path_word


def arguments(config: Config) -> list[str]:
    """How every case is coarsened and refined."""
    part = config["coarsening"]
    forest = part["forest"] and path_word(part["forest"])
    return options({"forest": forest, "modes": part["modes"], "refine_to": part["refine_to"]})


COARSENING = CaseStudy(
    name="coarsening",
    title="The worst modes of coarse models",
    results="results:CoarseningStudy",
    tables=("summary", "cases", "costs", "modes", "elements", "truths", "provenance"),
    arguments=arguments,
    outputs=(("out", ".json"), ("pictures", ".h5")),
    figures=(
        Figure("expected", "plots:expected_figure", "tables/cases.json"),
        Figure("errors", "plots:errors_figure", "tables/cases.json"),
    ),
)
