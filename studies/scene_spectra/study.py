"""What the study is made of."""

from __future__ import annotations

from studies.base.study import Figure, Study

SCENE_SPECTRA = Study(
    name="scene_spectra",
    package="studies.scene_spectra",
    folder="",
    title="One scene by several modes",
    results="results:SceneSpectra",
    page="page:page",
    figures=(
        Figure("scene-spectrograms", "plots:spectrograms_figure", "tables/scene_spectra.json"),
    ),
)
