"""What the study is made of."""

from __future__ import annotations

from studies.base.study import Study

SCENES = Study(
    name="scenes",
    package="studies.scenes",
    folder="scenes",
    title="Scenes of solids that sound",
    results="results:Scenes",
    page="page:page",
)
