"""What the study is made of."""

from studies.base.cases import CaseStudy, case_options
from studies.base.study import Figure

DISCRETISATION = CaseStudy(
    name="discretisation",
    title="Voxels, coarse elements and finite cells",
    results="results:DiscretisationStudy",
    tables=("summary", "cases", "truths", "provenance"),
    arguments=lambda config: case_options(config, "discretisation", "modes", "runs"),
    timed=True,
    figures=(
        Figure("unknowns", "plots:unknowns_figure", "tables/cases.json"),
        Figure("seconds", "plots:seconds_figure", "tables/cases.json"),
    ),
)
