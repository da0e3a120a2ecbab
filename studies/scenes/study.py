"""What the study is made of."""

from studies.base.study import Study
from studies.scenes.examples import TOLD, scenes

SCENES = Study(
    name="scenes",
    title="Scenes of solids that sound",
    results="results:Scenes",
    tables=("scenes", "files", "impacts"),
    file="index.html",
    measured=lambda config: [f"{name}/{TOLD}" for name in scenes(config)],
)
