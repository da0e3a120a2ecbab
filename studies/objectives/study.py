"""What the study is made of."""

from __future__ import annotations

from studies.base.cases import case_files
from studies.base.study import Figure, Study

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
