"""The claims as one page."""

from studies.base.page import StudyPage, section
from studies.base.parts import div, element, grid, html, picture_uri, prose, tiles
from studies.base.table import Table
from studies.claims.findings import IN_PART, LESS, NOT, REPRODUCED
from studies.claims.results import Claims
from studies.claims.tables import NO_MESH

STYLES = {REPRODUCED: "passed", LESS: "passed", IN_PART: "", NOT: "failed"}
"""Styles of the tiles that count verdicts."""


def page(claims: Claims, tables: dict[str, Table]) -> StudyPage:
    """Build the page from its tables; nothing is computed anew."""
    verdicts = [row["verdict"] for row in tables["claims"].rows]
    counts = (
        (str(verdicts.count(name)), element("b", name), style) for name, style in STYLES.items()
    )
    absent = ", ".join(row["solid"] for row in tables["solids"].having({"note": NO_MESH}))
    picture = claims.scene_picture and html(
        """<figure class="plot wide"><img src="{}" alt="Spectrograms of a scene from the truth’s
        and from coarse modes" style="max-width: 100%"></figure>""",
        picture_uri(claims.scene_picture),
    )
    led = html("""<a href="../scene-spectra.html">The scene’s own page</a> lets them be heard.""")
    none = "This run has no scene from both; single strikes stand on the pages of the validation."
    return StudyPage(
        title="The paper’s claims",
        kicker="the paper beside measurements",
        lede=html("""What Yamamoto and Igarashi claim in <cite>Interactive Physically-Based Sound
            Design of 3D Model using Material Optimization</cite> (SCA 2016), what is measured
            here, and why it agrees or does not."""),
        sections=[
            section("Claims", tiles(*counts), div("claims", grid(tables["claims"]))),
            section(
                "Fig. 11, solid by solid",
                grid(tables["solids"]),
                prose(
                    absent
                    and f"""Not measured, as their meshes are not at hand: {absent}. Built-in
                    solids stand in for them in the tables of the figures."""
                ),
                menu="Solids",
            ),
            section(
                "A scene from fine and coarse modes (Fig. 13)",
                picture,
                grid(claims.scene) if claims.scene else "",
                prose(led if claims.scene else none),
                menu="Scene",
            ),
            section("Sources", grid(tables["sources"])),
        ],
    )
