"""What the study is made of."""

from __future__ import annotations

from studies.base.cases import case_files
from studies.base.study import Figure, Study

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
