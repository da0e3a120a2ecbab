"""The study of the objectives as one page."""

from markupsafe import Markup

from solver.coarsening.forest import FOREST
from studies.base import parts
from studies.base.page import Section, StudyPage, origins, section
from studies.base.parts import grid, html, prose
from studies.base.table import Table
from studies.objectives.goals import rms_limits
from studies.objectives.results import Objectives

Tables = dict[str, Table]


def page(study: Objectives, tables: Tables) -> StudyPage:
    """Build the page from the tables and figures of a study; nothing is computed anew."""
    by_forest = ", and how close with forests that have learned it" if study.forest else ""
    return StudyPage(
        title="Which objective has the best spectra?",
        kicker="comparison of fit objectives",
        lede=f"""{len(study.coarsenings)} coarsenings, {len(tables["truths"].rows)} fine spectra:
            how close do the frequencies come when every block of 2×2×2 voxels is replaced by its
            own fit{by_forest}?""",
        sections=[
            _verdict(study, tables),
            section("Goals", grid(tables["goals"]), _goal_cases(study, tables)),
            section(
                "Forests instead of fits",
                prose(_forest(study, tables["forest"])),
                grid(tables["forest"]) if tables["forest"].rows else "",
                menu="Forests",
                id="forest",
            ),
            section(
                "Solids",
                parts.div("panels", *(_figure(study, solid) for solid in study.solids)),
                *(_solid(study, tables["errors"], solid) for solid in study.solids),
            ),
            section(
                "Objectives and materials",
                parts.div("pair", grid(tables["objectives"]), grid(tables["materials"])),
                menu="Objectives",
            ),
            section("Evidence", grid(tables["truths"], by="model")),
            origins(tables["provenance"]),
        ],
    )


def _verdict(study: Objectives, tables: Tables) -> Section:
    rows = {row["coarsening"]: row for row in tables["summary"].rows}
    best = next(row for name, row in rows.items() if name != FOREST)
    (goals,) = tables["goals"].having({"coarsening": best["coarsening"]})
    span = f"7–{study.last['audible']}"
    fewer = "; ".join(shortened(study))
    return section(
        "Verdict",
        parts.tiles(
            (
                "{best[coarsening]}",
                """has the smallest frequency error over all solids and materials:
                    <b>{best[all_rms]:percent}</b> rms over modes {span}""",
                "hcms_ec",
            ),
            (
                "{best[all_worst]:percent}",
                "is its worst single frequency: {best[all_where]}",
                "ddfem_hcms_ec",
            ),
            (
                "{rows[galerkin][all_rms]:percent}",
                """rms by <b>Galerkin projection</b>, {rows[average][all_rms]:percent} by
                    averaging moduli""",
            ),
            ("{goals[met]}", "<b>goals</b> are met by {best[coarsening]}", "proof"),
            best=best,
            rows=rows,
            span=span,
            goals=goals,
        ),
        parts.note(study.without),
        prose(
            fewer
            and f"""Coarse models with fewer modes than were asked for are judged by those they
            have: {fewer}.""",
            f"""Every solid was given every material, {len(tables["materials"].rows)} in all, at
            every resolution, and its lowest modes were computed on the fine mesh by SLEPc, with a
            proof that none is missing. Each coarsening then made one element of every block of
            2×2×2 voxels; the coarse models differ in nothing but the moduli, so that their
            frequencies tell the objectives apart.""",
        ),
        grid(tables["summary"]),
        grid(tables["summary-all"]),
    )


def shortened(study: Objectives) -> list[str]:
    """Cases whose coarse model has fewer modes than were asked for, in words."""
    return [
        f"{study.label(case)} ({last} modes)"
        for case, rating in study.ratings.items()
        if (last := rating["rows"][0]["all"]["last"]) < rating["modes"]
    ]


def _goal_cases(study: Objectives, tables: Tables) -> Markup | str:
    table = tables["goal-cases"]
    if not table.rows:
        return ""
    return grid(table, skip=("title",), by="goal", judged=study.coarsenings)


def _forest(study: Objectives, table: Table) -> str:
    if table.rows:
        return html(
            """Forests that have learned {forest_objective} take the place of its fit in the row
            <b>ddfem</b> ({forest}, SHA-256 {forest_sha256}…). Their rms error is {median:percent}
            of the fit’s in the median case, and {worst:percent} in the worst: {where}.""",
            **{**table.rows[-1], **(study.forest or {})},
        )
    if study.forest:
        return f"""The forests have learned {study.forest["forest_objective"]}, which is not among
            the objectives of this study."""
    return study.without_forest or "no forests were compared"


def _figure(study: Objectives, solid: str) -> Markup:
    resolutions = study.part["models"][solid]["resolutions"]
    hollow = ", hollow below" if len(set(resolutions)) > 1 else ""
    goal = "; the dashed line is the goal of the rms" if rms_limits(study, solid) else ""
    return parts.figure(
        parts.element("h3", study.titles[solid]),
        study.drawn(solid),
        caption=f"""Root mean square of the relative frequency errors of modes
            7–{study.last["audible"]} by objective, one marker a material; filled at
            resolution {max(resolutions)}{hollow}. The axis is logarithmic{goal}.""",
        class_="plot",
        id=f"plot-{solid}",
    )


def _solid(study: Objectives, errors: Table, solid: str) -> Markup:
    rows = errors.having({"model": solid})
    sizes = {row["resolution"]: row for row in rows}
    return parts.article(
        f"model-{solid}",
        study.titles[solid],
        parts.facts(
            study.part["models"][solid]["mesh"],
            *(
                html(
                    """<span>resolution {resolution}: {unknowns:count} unknowns, coarsened
                    {coarse_unknowns:count}</span>""",
                    **row,
                )
                for row in sizes.values()
            ),
        ),
        grid(
            errors,
            rows,
            ("title", "unknowns", "coarse_unknowns"),
            caption=solid == study.solids[0],
            by="material",
        ),
    )
