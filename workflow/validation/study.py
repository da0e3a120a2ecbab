"""What the study is made of."""

from studies.base.study import Study

VALIDATION = Study(
    name="validation",
    package="workflow.validation",
    folder="",
    title="Validation",
    results="evidence:Evidence",
    tables=(
        *("criteria", "solid", "regions", "errors", "shapes", "audits", "responses"),
        "provenance",
    ),
    file="validation/{model}.html",
)
