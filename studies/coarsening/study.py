"""What the study is made of."""

from studies.base.cases import CaseStudy, case_options
from studies.base.study import Figure

COARSENING = CaseStudy(
    name="coarsening",
    title="The worst modes of coarse models",
    results="results:CoarseningStudy",
    tables=("summary", "cases", "costs", "modes", "elements", "truths", "provenance"),
    arguments=lambda config: case_options(config, "coarsening", "modes", "refine_to"),
    outputs=(("out", ".json"), ("pictures", ".h5")),
    figures=(
        Figure("expected", "plots:expected_figure", "tables/cases.json"),
        Figure("errors", "plots:errors_figure", "tables/cases.json"),
    ),
)
