"""The study of the discretisations as one page."""

from studies.accuracy.results import AccuracyStudy
from studies.base.page import StudyPage, origins, section
from studies.base.parts import grid, html, note, plot, prose
from studies.base.table import Table

FIGURES = {
    "unknowns": """Rms error over unknowns; both axes are logarithmic, and further down and further
        left is better.""",
    "seconds": """Rms error over the wall time from the surface to the modes; both axes are
        logarithmic, and further down and further left is better.""",
}


def page(study: AccuracyStudy, tables: dict[str, Table]) -> StudyPage:
    """Build the page from the tables and figures of a study; nothing is computed anew."""
    measured = study.measured
    count = len(measured["references"])
    problems = (row for row in tables["levels"].rows if row.get("problem"))
    rivals = html(
        """Tetrahedra stand for what one would take elsewhere: meshed by Gmsh {gmsh} from the
        solid’s exact description, with curved faces where they are quadratic, assembled by
        scikit-fem {scikit_fem}, and solved by SLEPc with a sparse Cholesky of MUMPS. Voxels and
        finite cells are given triangles, and solved by HCMS with correction.""",
        **{name.replace("-", "_"): each for name, each in measured["packages"].items()},
    )
    return StudyPage(
        title="How near do the frequencies come to those of the solid?",
        kicker="discretisations against references that no mesh made",
        lede=f"""{count} solid{"s" * (count > 1)} with a closed form, turned by
            {", ".join(str(int(angle)) for angle in measured["angles"])} degrees against the
            lattice: how far are the first {measured["elastic_modes"]} elastic frequencies off, and
            what do unknowns and time buy?""",
        sections=[
            section(
                "At equal cost",
                note(study.without) or prose(rivals),
                grid(tables["summary"], by="title"),
                *(plot(study.drawn(name), text, name) for name, text in FIGURES.items()),
                id="equal",
            ),
            section(
                "Every model",
                grid(tables["levels"], by="title"),
                prose(*(html("{title}, {label}: {problem}.", **row) for row in problems)),
                id="levels",
            ),
            section("References", grid(tables["references"])),
            origins(tables["provenance"]),
        ],
    )
