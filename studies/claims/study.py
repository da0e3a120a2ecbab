"""What the study is made of."""

from __future__ import annotations

from studies.base.study import Study

CLAIMS = Study(
    name="claims",
    package="studies.claims",
    folder="claims",
    title="The paper's claims",
    results="results:Claims",
    page="page:page",
)
