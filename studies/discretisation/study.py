"""What the study is made of."""

from __future__ import annotations

from studies.base.cases import case_files
from studies.base.study import Figure, Study

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
