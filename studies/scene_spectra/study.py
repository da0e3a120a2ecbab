"""What the study is made of."""

from studies.base.study import Figure, Study
from studies.scene_spectra.scene import FOLDER, RENDERINGS, SOUND, TOLD

SCENE_SPECTRA = Study(
    name="scene_spectra",
    folder="",
    title="One scene by several modes",
    results="results:SceneSpectra",
    tables=("scene_spectra",),
    file="scene-spectra.html",
    measured=lambda config: [f"{FOLDER}/{n}/{file}" for n in RENDERINGS for file in (SOUND, TOLD)],
    figures=(
        Figure("scene-spectrograms", "plots:spectrograms_figure", "tables/scene_spectra.json"),
    ),
)
