"""The page of the scene that is heard by several modes."""

from __future__ import annotations

from studies.base.page import inline, rendered
from studies.base.table import Table
from studies.scene_spectra.results import FOLDER, SceneSpectra
from studies.scene_spectra.scene import RENDERINGS, SOUND


def page(results: SceneSpectra, tables: dict[str, Table]) -> str:
    """Build the page from its table and figure; sounds stay files beside it."""
    distances = {
        row["rendering"]: row.get("distance_decibels") for row in tables["scene_spectra"].rows
    }
    return rendered(
        "studies/scene_spectra/page.html.j2",
        title="One scene by several modes",
        config=results.part,
        tables=tables,
        spectrograms=inline(results.figure("scene-spectrograms.svg")),
        heard=[
            (f"{FOLDER}/{name}/{SOUND}", each, distances[name]) for name, each in RENDERINGS.items()
        ],
    )
