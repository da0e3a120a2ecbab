"""The page that shows all scenes; films and sounds stay files beside it."""

from studies.base.page import Section, StudyPage, section
from studies.base.parts import audio, element, figure, grid, html, prose
from studies.base.table import Table
from studies.scenes.examples import OUTPUTS, SceneExample
from studies.scenes.results import Scenes

FOOTER = html("""This page holds its numbers, which are also files in
    <span class="file">tables/</span> beside it; films and sounds are files in a folder for each
    scene.""")
LED = {"video": "film", "out": "sound", "gltf": "motion", "impacts": "impacts"}
"""Files of a scene that the page leads to, in a word."""


def page(results: Scenes, tables: dict[str, Table]) -> StudyPage:
    """Build the page from its tables."""
    scenes = [scene.example for scene in results.scenes]
    return StudyPage(
        title="Scenes",
        kicker="examples",
        lede="""Solids that fall, roll and strike each other: each sounds by its own modes, where it
            is struck, as hard as it is struck.""",
        sections=[
            section("Overview", grid(tables["scenes"]), grid(tables["files"])),
            *(_scene(scene, tables["impacts"]) for scene in scenes),
        ],
        footer=FOOTER,
    )


def _scene(scene: SceneExample, impacts: Table) -> Section:
    files = [
        (OUTPUTS["page"], "Page on which every solid can be struck"),
        *((OUTPUTS[key], word) for key, word in LED.items()),
        *((file, "scene") for file in scene.files),
    ]
    led = [html('<a href="{}/{}">{}</a>', scene.name, *each) for each in files]
    film = element(
        "video",
        src=f"{scene.name}/{OUTPUTS['video']}",
        controls="controls",
        preload="metadata",
        aria_label=f"{scene.title}, film",
    )
    return section(
        scene.title,
        prose(f"{scene.about} ({scene.figure})", html("{}; {}", led[0], html(", ").join(led[1:]))),
        figure(
            film,
            audio(f"{scene.name}/{OUTPUTS['out']}", f"{scene.title}, sound"),
            caption=scene.notes,
        ),
        grid(impacts, impacts.having({"scene": scene.name}), skip=("title",)),
        id=scene.name,
    )
