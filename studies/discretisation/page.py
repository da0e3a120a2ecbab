"""The study of discretisations as one page."""

from studies.base.page import StudyPage, origins, section
from studies.base.parts import grid, html, note, plot, prose, tiles
from studies.base.table import Table
from studies.discretisation.results import DiscretisationStudy

MATERIALS = """A material is one function of place for all ways, defined by the voxels of the
    lattice: uniform and smooth ones are interpolated between the middles of voxels, of all others
    each voxel has a modulus of its own. Voxels, and finite cells of the same lattice, have it
    exactly; a coarse element of DDFEM* stands for 2×2×2 voxels and their moduli; finite cells half
    as fine see the arithmetic or the harmonic mean over the voxels of the solid in each 2×2×2. The
    refined model keeps blocks fine until its expected error is small enough."""
AGAINST = """Errors against the solid count what the lattice does to its shape; errors against the
    voxels are for whoever means the voxels themselves."""
TRUTH = """Nobody knows the frequencies of these solids. Finite cells come from above, and where
    edges point inwards their error falls with no more than the first power of the spacing; so what
    is left on the finest lattice is between nothing and its difference from the one before. With
    noise it falls faster, and at most three quarters are taken. The middle is taken for the truth,
    and half of the range is its doubt. An error that is no larger than the doubt says nothing."""
NEAREST = """rms error of the median solid with <b>{material}</b> material by the nearest way,
    {way}, with {n_dofs:score} of the voxels’ unknowns; the truth is known to {doubt:percent}"""


def page(study: DiscretisationStudy, tables: dict[str, Table]) -> StudyPage:
    """Build the page from the tables and figures of a study; nothing is computed anew."""
    ways: dict[str, list[dict]] = {material: [] for material in study.part["materials"]}
    for row in tables["summary"].rows:
        ways[row["material"]].append(row)
    best = [min(rows, key=lambda row: row["solid_median"]) for rows in ways.values()]
    figures = {
        "unknowns": f"""Rms error of the frequencies of modes 7–{study.last} against the
            solid over the unknowns of the model, a panel a material, a colour a way and a marker a
            solid; both axes are logarithmic.""",
        "seconds": "The same over the wall seconds from the surface to the modes.",
    }
    return StudyPage(
        title="Voxels, coarse elements or finite cells?",
        kicker="discretisations by material",
        lede=f"""{len(tables["truths"].rows)} solids with material: how near does each way to a
            spectrum come to the solid itself, with how many unknowns and in what time?""",
        sections=[
            section(
                "Verdict",
                tiles(
                    *((html("{solid_median:percent}", **row), html(NEAREST, **row)) for row in best)
                ),
                note(study.without),
                prose(MATERIALS, AGAINST),
                grid(tables["summary"], by="material"),
            ),
            section(
                "At equal cost",
                *(plot(study.drawn(name), text, name) for name, text in figures.items()),
                id="figures",
            ),
            section("Cases", grid(tables["cases"], by="material")),
            section("Truth", prose(TRUTH), grid(tables["truths"], by="title")),
            origins(tables["provenance"]),
        ],
    )
