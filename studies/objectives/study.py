"""What the study is made of."""

from dataset_gen import objectives
from studies.base.cases import CaseStudy, case_options
from studies.base.study import Config, Figure


def arguments(config: Config) -> list[str]:
    """What is compared in every case."""
    compared = ",".join(config["objectives"]["objectives"] or objectives.OBJECTIVES)
    return case_options(config, "objectives", "modes", objectives=compared)


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
