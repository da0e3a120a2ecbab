"""The study of thin walls as one page."""

from studies.base.page import Section, StudyPage, origins, section
from studies.base.parts import grid, html, listed, note, plot, prose
from studies.base.table import Table
from studies.thin_walls.results import ThinWallStudy

FIGURES = {
    "unknowns": """Rms error over unknowns; both axes are logarithmic, and further down and further
        left is better.""",
    "seconds": """Rms error over wall time; both axes are logarithmic, and further down and further
        left is better.""",
}
CONVERGENCE = """Rms error over the spacing of a smooth wall and of one with a joint; the dotted
    lines and the numbers beside the names are the fitted slopes."""


def page(study: ThinWallStudy, tables: dict[str, Table]) -> StudyPage:
    """Build the page from the tables and figures of a study; nothing is computed anew."""
    measured = study.measured
    rms, worst = measured["aims"]["thin"]
    of_thick, _ = measured["aims"]["thick"]
    aims = html(
        """{met} of {count} models of thin walls are at most {rms:percent} off, worst
        {worst:percent}, with at most {unknowns:count} unknowns; {met_thick} of {count_thick} of
        thick solids at most {of_thick:percent}.""",
        met=_met(tables["walls"]),
        count=len(tables["walls"].rows),
        met_thick=_met(tables["thick"]),
        count_thick=len(tables["thick"].rows),
        rms=rms,
        worst=worst,
        unknowns=measured["most_unknowns"],
        of_thick=of_thick,
    )
    return StudyPage(
        title="How near do finite cells come on thin curved walls?",
        kicker="finite cells against references that no cell made",
        lede=f"""Shells of revolution, pans and plates with walls down to 1/500 of their width,
            straight and turned against the lattice: how far are the first
            {measured["elastic_modes"]} elastic frequencies off, and what do unknowns and time
            buy?""",
        sections=[
            section(
                "Thin walls",
                prose(aims, *_problems(tables["walls"])),
                grid(tables["walls"], by="title"),
            ),
            section(
                "Thick solids",
                prose(*_problems(tables["thick"])),
                grid(tables["thick"], by="title"),
            ),
            *_over_size(study, tables),
            section("No mode too low", grid(tables["bounds"]), id="bounds"),
            section("References", prose(_facets(study)), grid(tables["references"])),
            origins(tables["provenance"]),
        ],
    )


def _met(table: Table) -> int:
    return len(table.having({"verdict": "met"}))


def _problems(table: Table) -> list[str]:
    problems = (row for row in table.rows if row.get("problem"))
    return [html("{title}, {position}: {problem}.", **row) for row in problems]


def _over_size(study: ThinWallStudy, tables: dict[str, Table]) -> list[Section | None]:
    if not study.over_size:
        return []
    packages = study.measured["packages"].items()
    rivals = packages and html(
        """Tetrahedra are meshed by Gmsh {gmsh} from the solid’s exact description, with curved
        faces, assembled by scikit-fem {scikit_fem}, and solved by SLEPc with a sparse Cholesky.""",
        **{name.replace("-", "_"): version for name, version in packages},
    )
    return [
        section(
            "At equal cost",
            note(study.without) or prose(rivals),
            grid(tables["summary"], by="title"),
            *(plot(study.drawn(name), text, name) for name, text in FIGURES.items()),
            listed("Every model", grid(tables["levels"], by="title")),
            id="equal",
        ),
        section("Convergence", plot(study.drawn("convergence"), CONVERGENCE, "convergence")),
    ]


def _facets(study: ThinWallStudy) -> str:
    if not (facets := study.measured["facets"]):
        return ""
    return html(
        """Surfaces of revolution have {sections} sections and the volume of the solid; twice as
        many change no frequency of the {title} by more than {change:percent}.""",
        **facets | {"title": facets["title"].lower()},
    )
