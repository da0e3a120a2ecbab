"""What the study is made of."""

from __future__ import annotations

from studies.base.study import Study

VALIDATION = Study(
    name="validation",
    package="workflow.validation",
    folder="",
    title="Validation",
    results="evidence:Evidence",
    page="page:page",
)
