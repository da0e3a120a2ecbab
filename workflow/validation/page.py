"""The page that says how far the spectra of one model can be trusted, and why."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from markupsafe import Markup, escape

from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.model import FiniteCellModel
from carillon.fem.geometry import load_surface
from carillon.records import provenance
from solver.response.response import STRIKE_SECONDS
from studies.base import parts
from studies.base.media import embedded, inlined, wav_uri
from studies.base.page import Section, StudyPage, listed_modes, origins, section
from studies.base.parts import grid, html, plot, prose, unbroken
from studies.base.table import Table
from workflow import settings
from workflow.report.page import mode_pictures, variant_name, variants_key
from workflow.validation import plots
from workflow.validation.criteria import verdict
from workflow.validation.distance import distance_in_words
from workflow.validation.evidence import COARSENED, Evidence
from workflow.validation.pictures import solid_pictures, struck_picture
from workflow.variants import TRUTH, VARIANTS

Tables = dict[str, Table]

_DIGITS = 16
PROVEN = """Residuals show that each pair is one of the matrices’ own. Orthogonality shows that no
    mode stands there twice. The count shows that none is missing. Together they leave no room for a
    wrong spectrum of these matrices."""
UNDIVIDED = """Finite cells are undivided here, as with <code>carillon modes --refine-to 0</code>,
    so that all methods solve one mesh. Without that option <code>modes</code> divides cells with
    large errors and comes nearer to the solid."""
COARSE_LIMIT = ", and for the worst of the coarsened solid’s frequencies 7–60 (right)"
CHOSEN = """ The ground truth chose both: where its six lowest elastic modes give way most to a
    push, and what moves most far from there."""
STRIKES = """Spectrograms of three strikes, {} s apart, at the arrow, at the ring and at {}, by a
    force of half a sine of {:fraction} ms. Each is heard at the point that is struck: the sum of
    a<sub>k</sub> exp(−ξ<sub>k</sub>ω<sub>k</sub>t) sin(ω<sub>d</sub>t) over the modes from 20 Hz to
    20 kHz, with a<sub>k</sub> = (u<sub>k</sub><sup>T</sup>f)(u<sub>k</sub><sup>T</sup>n). Every
    strike is played so that the ground truth’s are equally loud; levels are below its loudest.
    Radiation into the air is not modelled."""
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
            _solid(evidence),
            section(
                "spectrum",
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
                "shapes",
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
            section("proofs", "Proofs", prose(PROVEN, _counted(evidence)), grid(tables["audits"])),
            _motion(evidence, tables),
            _sound(evidence),
            _provenance(evidence, tables["provenance"]),
        ],
        footer=FOOTER,
    )


def _judged(evidence: Evidence, tables: Tables) -> tuple[Section, Section]:
    """The verdict in words, and its criteria one by one."""
    judged, distance = verdict(evidence), distance_in_words(evidence)
    taken = evidence.fine_taken(evidence.model)
    styles = {None: "", True: "passed", False: "failed"}
    items = (
        (part["word"], html("<b>{title}.</b> {sentence}", **part), styles[part["passed"]])
        for part in judged["parts"]
    )
    passed = "passed" if judged["passed"] else "failed"
    told = section(
        "verdict",
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
    return told, section("criteria", "Criteria", *articles, proof)


def _criteria(part: dict[str, Any], *further: Markup) -> Markup:
    """The criteria of a part of the verdict, each with the file and key of its number."""
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


def _lengths(values: Iterable[float]) -> str:
    return " × ".join(unbroken(each, "fraction") for each in values)


def _solid(evidence: Evidence) -> Section:
    """Pictures and sizes of the solid."""
    mesh_name = settings.mesh_of(evidence.config, evidence.model)
    part = evidence.settings
    surface = load_surface(mesh_name, part["unit"])
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
        "solid",
        "Solid",
        parts.facts(
            mesh_name,
            f"resolution {part['resolution']}",
            f"{part['material']} material",
            html("<span>density {density:count} kg/m³</span>", **part),
            f"Poisson’s ratio {evidence.config['poisson']}",
            html("<span>mass {:fraction} kg</span>", model.mass),
            f"mesh {_lengths(sides)} m",
            "" if cells else f"voxels {_lengths(np.ptp(mesh.nodes, axis=0))} m",
        ),
        parts.figure(parts.pictures(shown, "three"), caption=about),
        plot(
            inlined(plots.moduli_figure(young), "moduli"),
            "Young’s moduli of all voxels. Bars have the colours of the picture above.",
            width="narrow",
        ),
    )


def _counted(evidence: Evidence) -> str:
    """What was counted of the spectra, and what follows for those without a count."""
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


def _place(evidence: Evidence, name: str) -> str:
    """A point that is struck or watched, in the mesh's own coordinates."""
    position = evidence.response.contacts[name].position / evidence.settings["unit"]
    return parts.place(position.tolist())


def _motion(evidence: Evidence, tables: Tables) -> Section:
    """Where and how the solid is struck, and how it moves."""
    response, model = evidence.response, evidence.shown[TRUTH].model
    strike, observed = response.contacts["strike"], response.contacts["observed"]
    picture = struck_picture(model.mesh, strike, observed, evidence.skin(evidence.model, model))
    alt = f"{evidence.titles[evidence.model]}: where it is struck and watched"
    coarse = COARSENED in evidence.shown
    chosen = any(evidence.settings[name] is not None for name in ("strike", "observed"))
    where = f"""The arrow is where an impulse of 1 N·s strikes along the inward normal, at
        {_place(evidence, "strike")}; the ring is the point that is watched, at
        {_place(evidence, "observed")}, in the mesh’s own coordinates.{"" if chosen else CHOSEN}"""
    how = html(
        """A free body also flies off and turns. That rigid motion is left out; the elastic modes
        alone are superposed. Damping is Rayleigh’s, {mass_damping:fraction} s⁻¹ of the mass and
        {stiffness_damping:small} s of the stiffness.{}""",
        """ The coarsened solid is watched at the same point, interpolated in the cell that it lies
        in."""
        if coarse
        else "",
        **response.attributes,
    )
    about = html(
        """Displacement of the ringed point over {:fraction} ms, along the direction in which it
        moves most, and length of its difference from the ground truth’s over the ground truth’s
        largest displacement. A frequency that is slightly off runs out of step after some swings,
        so {} difference grows although it moves alike.""",
        1e3 * float(response.seconds[-1]),
        "the coarsened solid’s" if coarse else "a",
    )
    return section(
        "motion",
        "Motion after a strike",
        parts.div(
            "beside",
            parts.figure(parts.image(embedded(picture), alt)),
            parts.element("div", parts.element("p", where), parts.element("p", how)),
        ),
        plot(inlined(plots.motion_figure(response), "motion"), about),
        grid(tables["responses"]),
        menu="Motion",
    )


def _sound(evidence: Evidence) -> Section:
    """Sound and spectrogram of every method; a sentence if no mode of the truth is heard."""
    response = evidence.response
    if not response.responses[TRUTH].sound.any():
        surface = load_surface(
            settings.mesh_of(evidence.config, evidence.model), evidence.settings["unit"]
        )
        sides = _lengths(np.ptp(np.asarray(surface.bounds), axis=0))
        silent = f"""Nothing is to be heard: no elastic mode lies between 20 Hz and 20 kHz. Check
            the unit of the mesh; the solid measures {sides} m."""
        return section("sound", "Sound", prose(silent))
    loudest = max(float(np.abs(part.sound).max()) for part in response.responses.values())
    rate = int(response.attributes["sample_rate"])
    panels = []
    for variant, part in response.responses.items():
        away = html(", {:small} dB from the ground truth", part.distance_decibels)
        heard = html(
            "<span>{} modes heard{}</span>", part.audible, "" if variant == TRUTH else away
        )
        drawn = inlined(plots.sound_figure(response, variant), f"sound-{variant}")
        source = wav_uri(part.sound, rate, loudest)
        player = parts.audio(source, f"Sound by {VARIANTS[variant].label}")
        told = parts.facts(variant_name(variant), heard)
        panels.append(parts.figure(told, drawn, player, class_="plot"))
    contact = 1e3 * response.attributes["contact_seconds"]
    about = html(STRIKES, STRIKE_SECONDS, _place(evidence, "third"), contact)
    proof = parts.element("p", about, class_="proof")
    return section("sound", "Sound", parts.div("panels", *panels), proof)


def _provenance(evidence: Evidence, table: Table) -> Section:
    """Files, the page's own origin, and the part of the configuration that tells on the solid."""
    record = provenance.record({"config": evidence.config})
    page = html(
        "rule validate_model; commit {commit}, hash of the configuration {config_hash}", **record
    )
    begins = "SHA-256 begins with <code>{}</code>"
    files = ((_wrapped(name), html(begins, digest)) for name, digest in _digests(evidence))
    own = origins(table, "at the end of this page, its part that tells on this solid")
    return section(
        own.id,
        own.title,
        own.content,
        parts.definitions([("This page", page), *files], class_="machine"),
        parts.element("pre", _configuration(evidence), class_="config"),
    )


def _digests(evidence: Evidence) -> list[tuple[str, str]]:
    """Names and first digits of the SHA-256 of the files that everything is made from."""
    given = settings.model_files(evidence.config, evidence.model)
    made = [str(evidence.modes_path(evidence.model, variant)) for variant in evidence.shown]
    digests = []
    for name in given + made:
        with open(name, "rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()[:_DIGITS]
        digests.append((Path(name).name, digest))
    return digests


def _configuration(evidence: Evidence) -> str:
    """The part of the configuration that tells on this solid."""
    config = evidence.config
    parts = {key: config[key] for key in ("poisson", "solver", "validation")}
    forests = {"model": config["forests"]["model"]}
    return yaml.safe_dump(
        {"models": {evidence.model: evidence.settings}, "forests": forests, **parts},
        sort_keys=False,
    )
