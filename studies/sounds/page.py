"""The page of an example: targets and design, to see and to hear."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import trimesh
import yaml
from markupsafe import Markup
from numpy.typing import NDArray

from sound.strikes import Place, locate_all
from studies.base.media import embedded, inlined
from studies.base.page import Section, StudyPage, origins, section
from studies.base.parts import (
    definitions,
    div,
    element,
    figure,
    grid,
    html,
    image,
    key,
    listed,
    pictures,
    plot,
    prose,
    styled,
    tiles,
)
from studies.base.table import Table
from studies.sounds import heard, plots
from studies.sounds.examples import DESIGN, ELSEWHERE, PROJECT, REACHED, START, TRUTH
from studies.sounds.pictures import ELSEWHERE_CLASS, Mark, marks_of, material_pictures
from studies.sounds.results import MODES, SoundResults

Array = NDArray[np.float64]
Sound = tuple[Array, int]
Tables = dict[str, Table]

FOOTER = html("""This page holds all of its figures, sounds and numbers; its tables are also files
    in <span class="file">tables/</span> beside it. Frequencies are in Hz, dampings in 1/s, moduli
    in Pa.""")


def page(results: SoundResults, tables: dict[str, Table]) -> StudyPage:
    """Build the page of an example from its tables and files."""
    example, design = results.example, results.design
    marks = marks_of(design)
    elsewhere = _elsewhere(results)
    project = yaml.safe_dump(design.settings, sort_keys=False)
    provenance = origins(tables["provenance"], "config.yaml in the folder above the examples")
    return StudyPage(
        title=example.title,
        kicker=f"sound design · {example.figure}",
        lede=example.about,
        sections=[
            _result(results, tables),
            heard.sounds(results, tables, marks, elsewhere),
            _material(results, marks, elsewhere),
            section(
                "Modes",
                grid(tables["frequencies"]),
                listed(
                    "Amplitudes of all modes at all points", grid(tables["amplitudes"], by="point")
                ),
            ),
            section(
                "Checked on the fine model",
                grid(tables["truth"]),
                grid(tables["checks"]) if design.evidence.get("checks") else "",
                menu="Fine model",
                id="truth",
            ),
            section("What the solid can have", grid(tables["reach"]), menu="Reach")
            if "reach" in tables
            else None,
            _optimisers(results, tables) if results.optimisers else None,
            section("Files", definitions(_files(results), class_="machine files")),
            provenance._replace(
                content=provenance.content + element("pre", project, class_="config")
            ),
        ],
        footer=FOOTER,
    )


def _result(results: SoundResults, tables: Tables) -> Section:
    design, edits = results.design, tables["designs"].rows
    worst = {
        state: max(abs(row[f"{state}_bark"]) for row in tables["frequencies"].rows)
        for state in ("start", "found")
    }
    several = len(edits) > 1
    verdict = design.evidence.get("verdict")
    last = " in the last edit" if several else ""
    frequencies = plots.frequency_figure(tables["frequencies"], tables["truth"])
    added = " At every dotted line a target is added, and the search goes on from where it was."
    return section(
        "Result",
        tiles(
            (
                "{fall:share}",
                "<b>Fall of the cost</b>{last}, from {cost_before:score} to {cost:score}",
                "ddfem_hcms_ec",
            ),
            (
                "{worst[found]:fraction} bark",
                """<b>Largest difference</b> of a frequency from its target;
                    {worst[start]:fraction} bark with the uniform material""",
                "hcms_ec",
            ),
            (
                "{per_minute:count} a minute",
                """<b>Evaluations</b>: {evaluations:count} modal analyses of
                    {design.model.n_dofs:count} unknowns in {seconds:seconds}""",
                "speed",
            ),
            (
                f"{len(design.frequencies)} modes",
                html(
                    """<b>Controlled</b> at {} struck points, {:count} voxels, by {} coordinates of
                    the material""",
                    len(design.targets.names),
                    len(design.young),
                    len(design.coordinates),
                ),
                "proof",
            ),
            **edits[-1],
            last=last,
            worst=worst,
            design=design,
        ),
        div(
            "pair",
            plot(
                inlined(plots.cost_figure(results), "cost"),
                f"""Cost of the best material so far over processor time, and the weighted parts
                that it is the sum of.{added if several else ""}""",
                width="",
            ),
            plot(
                inlined(frequencies, "frequencies"),
                """Differences of the modes’ frequencies from their targets, in critical bands of
                hearing.""",
                width="",
            ),
        ),
        prose(html("<b>Verdict</b> of carillon design: {}.", verdict["sentence"]))
        if verdict
        else "",
        grid(tables["designs"]),
        grid(tables["nearness"]),
    )


def _material(results: SoundResults, marks: list[Mark], elsewhere: Mark) -> Section:
    design, name = results.design, results.example.elsewhere[0]
    sides = ("from the front", "from behind")
    pictured = material_pictures(design, [*marks, elsewhere])
    shown = [
        image(embedded(each), f"{results.example.title}: moduli, {side}")
        for each, side in zip(pictured, sides)
    ]
    colours = [
        *((styled(mark.style, each), "") for each, mark in zip(design.targets.names, marks)),
        (styled(elsewhere.style, name), "without a target"),
    ]
    about = html(
        """Young’s modulus of the voxels at the surface, from two opposite sides; arrows are the
        strikes that are heard above. Within the solid it ranges from {:small} to {:small} Pa,
        median {:small} Pa. A factor common to all moduli brings the frequencies nearest to their
        targets.""",
        *(design.young.min(), design.young.max(), np.median(design.young)),
    )
    bar = div("plot narrow", inlined(plots.colour_bar(design.young), "colours"))
    key_of = key(colours, "Struck points and their colours")
    return section("Material", figure(pictures(shown, "two"), key_of, bar, caption=about))


def _optimisers(results: SoundResults, tables: Tables) -> Section:
    drawn = inlined(plots.optimisers_figure(results.optimisers), "optimisers")
    return section(
        "Optimisers",
        plot(drawn, "Cost of the best material so far, by optimiser.", width="narrow"),
        grid(tables["optimisers"]),
        grid(tables["evaluation"]),
    )


def _elsewhere(results: SoundResults) -> Mark:
    surface = trimesh.Trimesh(
        results.design.surface_vertices, results.design.surface_faces, process=False
    )
    (strike,) = locate_all(surface, [Place(*results.example.elsewhere)], results.design.unit)
    return Mark(ELSEWHERE_CLASS, strike.position, strike.inward)


def _files(results: SoundResults) -> Iterator[tuple[Markup, Markup]]:
    descriptions = {
        PROJECT: "the project, for carillon design",
        DESIGN: "the design: material, modes, targets, history",
        START: "the same with the uniform material that the search began with",
        TRUTH: "modes of the fine model with the material found",
        "young.npy": "Young’s modulus [Pa] of every voxel, for carillon modes --material",
        "optimisers.json": "the optimisers beside each other",
        REACHED: "which modes the solid can have",
    }
    for state, what in heard.STATES.items():
        for name in results.design.targets.names:
            said = f"{name}, {what[0].lower()}{what[1:]}"
            descriptions[f"{state}/{name}.wav"] = said
            descriptions[f"{state}/{MODES}/{name}.wav"] = f"{said}, modes alone"
    said = f"{results.example.elsewhere[0]}, without a target"
    descriptions[f"after/{ELSEWHERE}.wav"] = said
    descriptions[f"after/{MODES}/{ELSEWHERE}.wav"] = f"{said}, modes alone"
    for part in results.example.parts[:-1]:
        below = Path(part).name
        descriptions[f"{below}/{DESIGN}"] = f"the design after {below.replace('-', ' ')}"
    for name, what in descriptions.items():
        if (file := results.file(name)).is_file():
            link = html('<a href="{0}">{0}</a>', name)
            yield link, html("{}, {:bytes}", what, file.stat().st_size)
