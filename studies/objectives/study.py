"""What the study is made of."""

from __future__ import annotations

from dataset_gen import objectives
from studies.base.cases import CaseStudy
from studies.base.study import Config, Figure
from workflow.arguments import options, path_word


def arguments(config: Config) -> list[str]:
    """What is compared in every case."""
    part = config["objectives"]
    forest = part["forest"] and path_word(part["forest"])
    compared = ",".join(part["objectives"] or objectives.OBJECTIVES)
    return options({"forest": forest, "modes": part["modes"], "objectives": compared})


OBJECTIVES = CaseStudy(
    name="objectives",
    title="Objectives of the coarsening",
    results="results:Objectives",
    tables=(
        *("summary", "summary-all", "errors", "forest", "truths", "objectives", "materials"),
        *("provenance", "goals", "goal-cases"),
    ),
    arguments=arguments,
    figures=(
        Figure("{solid}", "plots:errors_figure", "tables/errors.json", of="objectives.models"),
    ),
)
