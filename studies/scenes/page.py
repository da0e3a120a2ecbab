"""The page that shows all scenes."""

from __future__ import annotations

from studies.base.page import rendered
from studies.base.table import Table
from studies.scenes.examples import OUTPUTS
from studies.scenes.results import Scenes


def page(results: Scenes, tables: dict[str, Table]) -> str:
    """Build the page from its tables; films and sounds stay files beside it."""
    return rendered(
        "studies/scenes/page.html.j2",
        title="Scenes",
        scenes=[scene.example for scene in results.scenes],
        impacts={
            scene.example.name: [
                row for row in tables["impacts"].rows if row["scene"] == scene.example.name
            ]
            for scene in results.scenes
        },
        files=OUTPUTS,
        tables=tables,
    )
