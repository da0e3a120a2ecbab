"""The study of the worst modes as one page."""

from dataclasses import replace
from functools import partial
from typing import Any

from markupsafe import Markup

from studies.base import parts
from studies.base.page import StudyPage, origins, section
from studies.base.parts import grid, html, plot, prose
from studies.base.table import Table
from studies.coarsening.pictures import mode_pictures
from studies.coarsening.results import CoarseningStudy
from studies.coarsening.tables import LABELS, METHODS, rank_correlation, speeds

Tables = dict[str, Table]


def page(study: CoarseningStudy, tables: Tables) -> StudyPage:
    """Build the page from the tables, figures and pictures of a study; nothing is computed anew."""
    plain, refined = tables["summary"].rows
    values: dict[str, Any] = {
        "plain": plain,
        "refined": refined,
        "goals": study.goals,
        "span": f"7–{study.last}",
        "correlation": rank_correlation(study),
    }
    say = partial(html, **values)
    solids = [solid for solid in study.solids if study.worst_of(solid) is not None]
    left = tables["modes"].having({"of": LABELS["refined"]})
    far_off = say(
        "Modes of the refined models that are more than {goals[far_off]:percent} off."
        if left
        else "No mode of the refined models is more than {goals[far_off]:percent} off."
    )
    verdict = section(
        "Verdict",
        parts.tiles(
            (
                "{plain[all_rms]:percent}",
                """rms error of the <b>coarse</b> models over modes {span};
                    worst {plain[all_worst]:percent}: {plain[all_where]}""",
                "ddfem_hcms_ec",
            ),
            (
                "{refined[all_rms]:percent}",
                """of the <b>refined</b> ones; worst {refined[all_worst]:percent}:
                    {refined[all_where]}""",
                "hcms_ec",
            ),
            (
                "{plain[far_off]:count}",
                """modes are more than {goals[far_off]:percent} off in the coarse models,
                    <b>{refined[far_off]:count}</b> in the refined ones; {plain[swap]} are there
                    under another number, {plain[local]} are local""",
            ),
            (
                "{correlation:score}",
                "<b>rank correlation</b> of expected and true rms errors over all cases",
                "proof",
            ),
            **values,
        ),
        parts.note(study.without),
        prose(
            say("""Every coarse element stands for the voxels of a block of 2×2×2 that hang
                together. The errors of its model’s frequencies are expected from two inverse
                iterations on the fine mesh, which know nothing of the exact modes. Where the
                expected rms is more than {goals[rms]:percent} or the worst more than
                {goals[worst]:percent}, blocks stay fine, or the whole solid if that saves no work.
                Here both are set beside the truth: the lowest modes of the fine mesh by SLEPc,
                with a proof that none is missing.""")
        ),
        grid(tables["summary"]),
    )
    errors = say("""Relative frequency errors of modes {span} by index, rms and the worst of each
        case; the axis is logarithmic, and the dashed lines are the goals, {goals[rms]:percent} for
        the rms and {goals[worst]:percent} for the worst. They are met by {plain[met]} of
        {plain[cases]} coarse models and by {refined[met]} of the refined ones.""")
    expected = say("""True rms error of the frequencies of modes {span} over the expected one, one
        marker a case; both axes are logarithmic, and on the line both are equal. Their rank
        correlation over all cases and both models is {correlation:score}.""")
    return StudyPage(
        title="Which modes does a coarse model get wrong?",
        kicker="errors of coarse models, mode by mode",
        lede=f"""{len(tables["cases"].rows)} fine spectra: which modes of the coarse model are off
            and why, was it to be expected, and what is left of it when the worst blocks, or all of
            them, stay fine?""",
        sections=[
            verdict,
            section(
                "Cases",
                grid(tables["cases"], by="title"),
                plot(study.drawn("errors"), errors, "errors"),
                plot(study.drawn("expected"), expected, "expected", "narrow"),
            ),
            section(
                "Modes far off",
                *(_solid(study, tables, solid, first=solid == solids[0]) for solid in solids),
                id="solids",
            )
            if solids
            else None,
            section(
                "After refinement",
                prose(far_off),
                grid(_with_titles(tables["modes"]), left, ("of",), by="title") if left else "",
                id="left",
            ),
            section(
                "Evidence",
                grid(tables["truths"], by="title"),
                prose(_speeds(study)),
                grid(tables["costs"], by="title"),
            ),
            origins(tables["provenance"]),
        ],
    )


def _with_titles(table: Table) -> Table:
    """The table with the column of the solid, which is hidden where the heading tells it."""
    columns = [replace(each, shown=each.shown or each.key == "title") for each in table.columns]
    return replace(table, columns=columns)


def _speeds(study: CoarseningStudy) -> Markup:
    names = ["the default method", *list(METHODS.values())[1:]]
    sentence = """By {} a coarse model with all that follows is {median:times} times as fast as the
        fine solid in the median, {least:times} to {most:times} times."""
    sentences = (html(sentence, name, **speeds(study, each)) for each, name in zip(METHODS, names))
    return parts.together(*sentences, between=" ")


def _solid(study: CoarseningStudy, tables: Tables, solid: str, first: bool) -> Markup:
    worst = study.worst_of(solid)
    assert worst is not None
    case, mode = worst
    title = study.titles[solid]
    plain = {"model": solid, "of": LABELS["plain"]}
    modes = tables["modes"].having(plain)
    elements = tables["elements"].having(plain | study.identity(case) | {"mode": mode["mode"]})
    shown = [
        parts.image(each, f"{title}, mode {mode['mode']}, coloured by {each['shows']}")
        + parts.element("p", each["shows"])
        for each in mode_pictures(study, case, mode["mode"])
    ]
    about = html(
        """{}: mode {mode}, {exact_hz:hertz} Hz, the worst of this solid ({error:percent},
        {verdict}), seen from where most of its energy is. Colours are shares of the strain energy
        and of the blame voxel by voxel, from a thousandth of the largest, dark, to the largest,
        bright.""",
        study.label(case),
        **mode,
    )
    count = f"{len(modes)} mode{'s' * (len(modes) > 1)} far off"
    return parts.article(
        f"model-{solid}",
        title,
        parts.facts(study.part["models"][solid]["mesh"], count),
        grid(tables["modes"], modes, ("of",), first, "material"),
        parts.div(
            "pair",
            parts.figure(parts.pictures(shown, "two"), caption=about),
            grid(tables["elements"], elements, caption=first),
        ),
    )
