"""The page that says how far the spectra of one model can be trusted, and why."""

import hashlib
import re
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from markupsafe import Markup, escape

from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.model import FiniteCellModel
from carillon.records import provenance
from studies.base import parts
from studies.base.media import embedded, inlined
from studies.base.page import Section, StudyPage, listed_modes, origins, section
from studies.base.parts import grid, html, plot, prose
from studies.base.table import Table
from workflow import settings
from workflow.composition import surface_of
from workflow.report.page import material_facts, mode_pictures
from workflow.report.verdict import variants_key
from workflow.validation import plots, strike
from workflow.validation.criteria import verdict
from workflow.validation.distance import distance_in_words
from workflow.validation.evidence import COARSENED, Evidence
from workflow.validation.pictures import solid_pictures
from workflow.variants import TRUTH

Tables = dict[str, Table]

_DIGITS = 16
PROVEN = """Residuals show that each pair is one of the matrices’ own. Orthogonality shows that no
    mode stands there twice. The count shows that none is missing. Together they leave no room for a
    wrong spectrum of these matrices."""
UNDIVIDED = """Finite cells are undivided here, as with <code>carillon modes --refine-to 0</code>,
    so that all methods solve one mesh. Without that option <code>modes</code> divides cells with
    large errors and comes nearer to the solid."""
COARSE_LIMIT = ", and for the worst of the coarsened solid’s frequencies 7–60 (right)"
FOOTER = html("""This page holds all of its figures and numbers; its tables are also files in
    <span class="file">tables/</span> beside it, and what it is made from lies in
    <span class="file">models/</span> in the folder above. Frequencies are in Hz, eigenvalues in
    rad²/s².""")


def page(evidence: Evidence, tables: Tables) -> StudyPage:
    """Build the page of a model from its tables and files."""
    ways = {3: "three", 4: "four"}[len(evidence.shown)]
    return StudyPage(
        title=evidence.titles[evidence.model],
        kicker="validation of one solid",
        lede=html(
            """The {:count} lowest vibration modes of one solid, computed {} ways: how far can the
            fast ones be trusted, and what says so?""",
            tables["audits"].rows[0]["modes"],
            ways,
        ),
        sections=[
            *_judged(evidence, tables),
            _solid(evidence, tables["regions"]),
            section(
                "Spectrum",
                plot(
                    inlined(plots.errors_figure(evidence, tables["errors"]), "errors"),
                    f"""Natural frequencies by mode number, and relative errors of eigenvalues and
                    frequencies against the ground truth. Dotted: the limit for the worst eigenvalue
                    of HCMS + EC (middle){COARSE_LIMIT if COARSENED in evidence.shown else ""}.
                    Errors below 10⁻¹² are drawn there.""",
                ),
                grid(tables["errors"], listed_modes(tables["errors"].rows)),
            ),
            section(
                "Shapes",
                mode_pictures(evidence, evidence.model),
                parts.div(
                    "pair",
                    plot(
                        inlined(plots.shapes_figure(evidence), "shapes"),
                        """Mass-weighted angle between the space of each cluster of modes of the
                        ground truth and the same modes of each method. Dotted: the limit for HCMS +
                        EC.""",
                        width="",
                    ),
                    grid(tables["shapes"]),
                ),
            ),
            section("Proofs", prose(PROVEN, _counted(evidence)), grid(tables["audits"])),
            strike.motion(evidence, tables["responses"]),
            strike.sound(evidence),
            _provenance(evidence, tables["provenance"]),
        ],
        footer=FOOTER,
    )


def _judged(evidence: Evidence, tables: Tables) -> tuple[Section, Section]:
    judged, distance = verdict(evidence), distance_in_words(evidence)
    taken = evidence.fine_taken(evidence.model)
    styles = {None: "", True: "passed", False: "failed"}
    items = (
        (part["word"], html("<b>{title}.</b> {sentence}", **part), styles[part["passed"]])
        for part in judged["parts"]
    )
    passed = "passed" if judged["passed"] else "failed"
    shown = section(
        "Verdict",
        parts.element("p", judged["headline"], class_=f"judgement {passed}"),
        prose(judged["advice"]),
        parts.tiles(*items, style="three" if len(judged["parts"]) == 3 else "two"),
        variants_key(evidence.shown),
        prose(
            taken
            and f"""The solid was not coarsened, and the fine one solved in place of a coarse one:
            {taken}.""",
            """HCMS without correction is where HCMS + EC starts. It is shown for comparison and not
            judged.""",
            f"{distance['meaning']} {distance['closer']}",
            html(UNDIVIDED) if _cells(evidence) else "",
            """What this page cannot show: whether moduli, density and damping are those of the real
            material; and how the surface radiates sound.""",
        ),
    )
    about = html(
        """Limits of the solvers follow from <code>solver.tolerance</code>, {:small}: if every
        eigenvalue is accurate to it, then residuals, angles and differences of motion can only be
        so large. Ten times as much is the limit of the eigenvalues themselves, since the correction
        stops by an estimate. Limits that <code>validation.tolerances</code> sets take their place,
        and those of frequencies stand there. Below every criterion stand the file and the key that
        its number comes from. <span class="file">tables/{}.csv</span>""",
        evidence.config["solver"]["tolerance"],
        tables["criteria"].name,
    )
    *others, last = judged["parts"]
    limits = "" if last["criteria"] else " This is told and not judged, since it has no limit."
    of_solid = (parts.element("p", f"{last['sentence']}{limits}"), grid(tables["solid"]))
    articles = [*map(_criteria, others), _criteria(last, *of_solid)]
    proof = parts.element("p", about, class_="proof")
    return shown, section("Criteria", *articles, proof)


def _criteria(part: dict[str, Any], *further: Markup) -> Markup:
    criteria = part["criteria"]
    if not criteria:
        return parts.article(None, part["question"], *further)
    met = sum(criterion.passed for criterion in criteria)
    line = """<tr><td>{label}<small>{why}</small><small class="file">{0}</small></td>
        <td class="number {verdict}" data-value="{found}">{shown}</td>
        <td class="number" data-value="{limit}">{required}</td></tr>"""
    rows = (criterion.row for criterion in criteria)
    lines = parts.together(*(html(line, _wrapped(row["source"]), **row) for row in rows))
    table = html(
        """<figure class="table"><table class="criteria" data-table="criteria">
        <thead><tr><th scope="col">Criterion</th><th scope="col" class="number">Found</th>
        <th scope="col" class="number">Required</th></tr></thead>
        <tbody>{}</tbody></table></figure>""",
        lines,
    )
    facts = parts.facts(part["title"], f"{met} of {len(criteria)} criteria met")
    return parts.article(None, part["question"], facts, table, *further)


def _wrapped(text: str) -> Markup:
    """Text in which a line may break after a slash, underscore or point."""
    return Markup(re.sub(r"([/_.])", r"\1<wbr>", str(escape(text))))


def _cells(evidence: Evidence) -> FiniteCells | None:
    """The cells of a model of finite cells; None of voxels."""
    model = evidence.shown[TRUTH].model
    return model.cells if isinstance(model, FiniteCellModel) else None


def _solid(evidence: Evidence, regions: Table) -> Section:
    mesh_name = settings.mesh_of(evidence.config, evidence.model)
    part = evidence.settings
    surface = surface_of(evidence.config, evidence.model)
    model = evidence.shown[TRUTH].model
    mesh, cells = model.mesh, _cells(evidence)
    young = model.young if cells else model.young[:, 0]
    share = cells.voxel_shares() if cells else None
    skin = evidence.skin(evidence.model, model)
    coarse = evidence.shown.get(COARSENED)
    sides = np.ptp(np.asarray(surface.bounds), axis=0)
    inside = html("closed, {:small} m³ inside", float(abs(surface.volume)))
    drawn = {
        "surface": html(
            "<b>Surface.</b> {:count} triangles, {}",
            len(surface.faces),
            inside if surface.is_watertight else "not closed",
        ),
        "voxels": html(
            """<b>Finite cells.</b> {:count} cells hold {:small} m³; shown are the {:count} cubes of
            {:small} m that hold any of it, the darker the more""",
            *(len(cells), cells.volume, mesh.n_cells, mesh.edge),
        )
        if cells
        else html(
            """<b>Voxels.</b> {:count} cubes of {:small} m, {:small} m³; {:count} cells after
            coarsening""",
            *(mesh.n_cells, mesh.edge, mesh.volume, coarse and coarse.mesh.n_cells),
        ),
        "material": html(
            "<b>Material.</b> Young’s moduli from {:small} to {:small} Pa, median {:small} Pa",
            *(float(young.min()), float(young.max()), float(np.median(young))),
        ),
    }
    title = evidence.titles[evidence.model]
    pictures = solid_pictures(surface, mesh, young, share, skin)
    shown = [
        parts.image(embedded(picture), f"{title}: {name}") + parts.element("p", text)
        for picture, (name, text) in zip(pictures, drawn.items(), strict=True)
    ]
    about = f"""The mesh as it was given, the voxels that {"it touches" if cells else "fill it"},
        and {"the surface" if cells else "the same voxels"} in the colours of their moduli, which
        are those of the histogram below. All are seen from the same side, at the same scale."""
    return section(
        "Solid",
        parts.facts(
            mesh_name,
            f"resolution {part['resolution']}",
            *material_facts(evidence, evidence.model),
            html("<span>mass {:fraction} kg</span>", model.mass),
            f"mesh {strike.lengths(sides)} m",
            "" if cells else f"voxels {strike.lengths(np.ptp(mesh.nodes, axis=0))} m",
        ),
        *([grid(regions)] if regions.rows else []),
        prose(_held(evidence)),
        parts.figure(parts.pictures(shown, "three"), caption=about),
        plot(
            inlined(plots.moduli_figure(young), "moduli"),
            "Young’s moduli of all voxels. Bars have the colours of the picture above.",
            width="narrow",
        ),
    )


def _held(evidence: Evidence) -> str:
    """What supports leave of a solid's rigid motions; empty if nothing supports it."""
    model = evidence.shown[TRUTH].model
    if model.supports is None:
        return ""
    mass = float(model.supports.mass.sum())
    with_mass = f", and {mass:g} kg are fixed to it" if mass else ""
    return f"""What holds it acts at {len(model.supports):,} points and leaves it
        {model.rigid_modes or "none"} of six rigid motions{with_mass}."""


def _counted(evidence: Evidence) -> str:
    counted = evidence.shown[TRUTH].attributes
    beyond = (
        f""" The run that made the ground truth went on to a gap beyond it:
        {counted["inertia_expected"]} found, {counted["inertia_count"]} counted."""
        if "inertia_count" in counted
        else ""
    )
    coarse = (
        """ The coarsened solid has matrices of its own; here it is proven that its modes are
        theirs, and above how far they are from those of the fine mesh."""
        if COARSENED in evidence.shown
        else ""
    )
    return f"""The count ends at the last gap before the last mode.{beyond} HCMS + EC has the same
        matrices and agrees with the ground truth mode by mode.{coarse}"""


def _provenance(evidence: Evidence, table: Table) -> Section:
    record = provenance.record({"config": evidence.config})
    page = html(
        "rule validate_model; commit {commit}, hash of the configuration {config_hash}", **record
    )
    begins = "SHA-256 begins with <code>{}</code>"
    files = ((_wrapped(name), html(begins, digest)) for name, digest in _digests(evidence))
    own = origins(table, "at the end of this page, its part that tells on this solid")
    return section(
        own.title,
        own.content,
        parts.definitions([("This page", page), *files], class_="machine"),
        parts.element("pre", _configuration(evidence), class_="config"),
        id=own.id,
    )


def _digests(evidence: Evidence) -> list[tuple[str, str]]:
    given = settings.model_files(evidence.config, evidence.model)
    made = [str(evidence.modes_path(evidence.model, variant)) for variant in evidence.shown]
    digests = []
    for name in given + made:
        with open(name, "rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()[:_DIGITS]
        digests.append((Path(name).name, digest))
    return digests


def _configuration(evidence: Evidence) -> str:
    config = evidence.config
    parts = {key: config[key] for key in ("poisson", "solver", "validation")}
    forests = {"model": config["forests"]["model"]}
    return yaml.safe_dump(
        {"models": {evidence.model: evidence.settings}, "forests": forests, **parts},
        sort_keys=False,
    )
