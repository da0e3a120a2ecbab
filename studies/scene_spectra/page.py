"""The page of the scene that is heard by several modes; sounds stay files beside it."""

from studies.base.page import StudyPage, section
from studies.base.parts import audio, figure, grid, html, plot, prose
from studies.base.table import Table
from studies.scene_spectra.results import SceneSpectra
from studies.scene_spectra.scene import FOLDER, RENDERINGS, SOUND

DISTANCE = """The distance between two sounds is the rms difference of their levels in third-octave
    bands, in windows of 23 ms. Modes that are close in frequency beat; an error of a fraction of a
    hertz shifts the beats in time, and counts in full."""
FOOTER = html("""This page holds its numbers, which are also files in
    <span class="file">tables/</span> beside it; sounds are files in
    <span class="file">scene_spectra/</span>.""")


def page(results: SceneSpectra, tables: dict[str, Table]) -> StudyPage:
    """Build the page from its table and figure."""
    table = tables["scene_spectra"]
    distances = {row["rendering"]: row.get("distance_decibels") for row in table.rows}
    levels = f"""Levels below the loudest of the ground truth, of all bodies together at the left
        ear; {results.part["modes"]} modes of every solid at resolution
        {results.part["resolution"]}."""
    heard = []
    for name, rendering in RENDERINGS.items():
        away = "" if distances[name] is None else f"; {distances[name]:.1f} dB from the truth"
        player = audio(f"{FOLDER}/{name}/{SOUND}", f"{rendering.title}, sound")
        heard.append(figure(player, caption=f"{rendering.title}: {rendering.about}{away}"))
    return StudyPage(
        title="One scene by several modes",
        kicker="reproduction of Fig. 13",
        lede="""Three solids of a material that varies smoothly fall on a floor. The same fall,
            contact by contact, is heard by the modes of the fine mesh and by those of coarse
            ones.""",
        sections=[
            section(
                "Spectrograms",
                plot(results.drawn("scene-spectrograms"), levels, "spectrograms"),
                menu="Spectrograms (Fig. 13)",
                id="spectrograms",
            ),
            section("Sounds", *heard),
            section("Numbers", grid(table), prose(DISTANCE)),
        ],
        footer=FOOTER,
    )
