"""The page of an example: targets and design, to see and to hear."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import trimesh
import yaml
from markupsafe import Markup
from matplotlib.figure import Figure
from numpy.typing import NDArray

from solver.response.response import spectrogram
from sound.rendering.listening import Listening
from sound.rendering.render import residual_share
from sound.rendering.solid import SoundingSolid
from sound.strikes import Place, locate_all
from studies.base.media import embedded, highest_hertz, inlined, spectrogram_figure, wav_uri
from studies.base.page import Section, StudyPage, origins, section
from studies.base.parts import (
    article,
    audio,
    definitions,
    div,
    element,
    facts,
    figure,
    grid,
    html,
    image,
    key,
    listed,
    pictures,
    place,
    plot,
    prose,
    styled,
    tiles,
)
from studies.base.table import Table
from studies.sounds import plots
from studies.sounds.examples import DESIGN, ELSEWHERE, PROJECT, REACHED, START, TRUTH
from studies.sounds.pictures import ELSEWHERE_CLASS, Mark, marks_of, material_pictures
from studies.sounds.results import CLIPS, MODES, SoundResults

Array = NDArray[np.float64]
Sound = tuple[Array, int]
Tables = dict[str, Table]

SHOWN_SECONDS, PLAYED_SECONDS = 1.0, 2.0
"""Longest time of a spectrogram and of a player."""
DIGITS = 6
"""Digits of coordinates behind the point."""
ROOM_ABOVE = 1.5
"""Highest frequency of a spectrogram over that of the highest target."""
SHOWN_HERTZ = 8000.0
"""Frequency up to which spectrograms of modes alone reach at least [Hz]."""
STATES = {
    "before": "Before",
    CLIPS: "Target",
    "after": "After",
    "fine": "After, on the fine model",
}
"""Folders of sounds, and their names for people."""
ALONE = {
    "modes": "All modes of the clip",
    "wanted": "Modes designed",
    "fine": "The same modes of the design, on the fine model",
}
"""Modes that are shown alone, and their names for people."""
SOUNDS = """Every point is struck along the inward normal. Before is the uniform material that the
    search began with; on the fine model the material found is solved without coarsening. Levels are
    below the loudest of the target, on one scale in every group. Noise of the clips is added to all
    but the target, which has it of its own; tones of a clip that are no modes are not. Modes alone,
    just as loud, can be heard below each sound."""
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
            _sounds(results, tables, marks, elsewhere),
            _material(results, marks, elsewhere),
            section(
                "modes",
                "Modes",
                grid(tables["frequencies"]),
                listed(
                    "Amplitudes of all modes at all points", grid(tables["amplitudes"], by="point")
                ),
            ),
            section(
                "truth",
                "Checked on the fine model",
                grid(tables["truth"]),
                grid(tables["checks"]) if design.evidence.get("checks") else "",
                menu="Fine model",
            ),
            section("reach", "What the solid can have", grid(tables["reach"]), menu="Reach")
            if "reach" in tables
            else None,
            _optimisers(results, tables) if results.optimisers else None,
            section("files", "Files", definitions(_files(results), class_="machine files")),
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
    say = partial(html, **edits[-1], worst=worst, design=design)
    frequencies = plots.frequency_figure(tables["frequencies"], tables["truth"])
    added = " At every dotted line a target is added, and the search goes on from where it was."
    return section(
        "result",
        "Result",
        tiles(
            (
                say("{fall:share}"),
                say(
                    "<b>Fall of the cost</b>{}, from {cost_before:score} to {cost:score}",
                    " in the last edit" if several else "",
                ),
                "ddfem_hcms_ec",
            ),
            (
                say("{worst[found]:fraction} bark"),
                say("""<b>Largest difference</b> of a frequency from its target;
                    {worst[start]:fraction} bark with the uniform material"""),
                "hcms_ec",
            ),
            (
                say("{per_minute:count} a minute"),
                say("""<b>Evaluations</b>: {evaluations:count} modal analyses of
                    {design.model.n_dofs:count} unknowns in {seconds:seconds}"""),
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
        ),
        div(
            "pair",
            plot(
                inlined(plots.cost_figure(results), "cost"),
                f"""Cost of the best material so far over wall time, and the weighted parts that it
                is the sum of.{added if several else ""}""",
                width="",
            ),
            plot(
                inlined(frequencies, "frequencies"),
                """Differences of the modes’ frequencies from their targets, in critical bands of
                hearing.""",
                width="",
            ),
        ),
        grid(tables["designs"]),
        grid(tables["nearness"]),
    )


def _sounds(results: SoundResults, tables: Tables, marks: list[Mark], elsewhere: Mark) -> Section:
    design, name = results.design, results.example.elsewhere[0]
    missed = Listening.of_design(design, SoundingSolid.of_design(design)).missed
    points = [
        _point(results, mark, share, plots.balance_figure(tables["amplitudes"], point), number)
        for number, (point, mark, share) in enumerate(zip(design.targets.names, marks, missed))
    ]
    rest = _panel(results, "after", ELSEWHERE, [results.sound("after", ELSEWHERE)], name)
    return section(
        "sounds",
        "Sounds",
        prose(SOUNDS),
        grid(tables["distances"]),
        *points,
        article(
            None,
            styled(elsewhere.style, name.capitalize()),
            facts("no target was given here"),
            div("panels", rest),
        ),
    )


def _point(
    results: SoundResults, mark: Mark, missed: float, balance: Figure, number: int
) -> Markup:
    """Sounds and balance of a struck point."""
    name = results.design.targets.names[number]
    position = np.round(mark.position / results.design.unit, DIGITS).tolist()
    sounds = [results.sound(state, name) for state in STATES]
    return article(
        None,
        styled(mark.style, name.capitalize()),
        facts(
            f"{place(position)} in the mesh’s own coordinates",
            html("<span>{:share} of the clip’s energy are tones that no mode has</span>", missed),
        ),
        div("panels", *(_panel(results, state, name, sounds, name) for state in STATES)),
        facts("Modes alone"),
        div("panels", *_modes_panels(results, name)),
        plot(
            inlined(balance, f"balance-{number}"),
            "Amplitudes of the modes at this point, as shares of the loudest.",
            width="narrow",
        ),
    )


def _panel(
    results: SoundResults, state: str, name: str, together: list[Sound], label: str
) -> Markup:
    """Spectrogram and players of a sound, scaled as those that are shown `together`."""
    sound, rate = results.sound(state, name)
    target = (sound, rate) if name == ELSEWHERE else results.sound(CLIPS, name)
    highest = min(highest_hertz(together), ROOM_ABOVE * results.design.targets.frequencies[-1])
    said = f"{label}, {STATES[state].lower()}"
    seen = _seen(f"{state}-{name}", (sound, rate), target, together, float(highest), said)
    alone: tuple[Markup, ...] = ()
    if state != CLIPS:
        modes = results.modes_alone(state, name)
        source = wav_uri(modes[: round(PLAYED_SECONDS * rate)], rate, _peak(together))
        share = residual_share(modes, sound - modes)
        noise = "modes alone, without the {:share} of the energy that are noise of the clips"
        alone = (facts(html(f"<span>{noise}</span>", share)), audio(source, f"{said}, modes alone"))
    return _shown(STATES[state], seen, *alone)


def _shown(state: str, *parts: Markup) -> Markup:
    return figure(facts(html('<span class="name">{}</span>', state)), *parts, class_="plot")


def _modes_panels(results: SoundResults, name: str) -> list[Markup]:
    """Modes alone at a point: those of its clip, those designed, and those of the design."""
    fine = results.modes_alone("fine", name)
    rate = results.sound("fine", name)[1]
    target = results.target(name, rate)
    sounds = dict(zip(ALONE, ((part, rate) for part in (target.modes, target.wanted, fine))))
    clip = (target.clip, rate)
    together = [clip, *sounds.values()]
    # Modes that are not designed may lie above those that are.
    enough = max(SHOWN_HERTZ, ROOM_ABOVE * results.design.targets.frequencies[-1])
    highest = float(min(highest_hertz([clip]), enough))
    panels = []
    for state, sound in sounds.items():
        said = f"{name}, {ALONE[state].lower()}"
        seen = _seen(f"alone-{state}-{name}", sound, clip, together, highest, said)
        panels.append(_shown(ALONE[state], seen))
    return panels


def _seen(
    label: str, own: Sound, target: Sound, together: list[Sound], highest: float, said: str
) -> Markup:
    """Spectrogram up to `highest` [Hz], below the loudest of the target, and player of a sound."""
    sound, rate = own
    loudest = float(spectrogram(*target)[2].max())
    seconds = min(SHOWN_SECONDS, max(len(each) / rate for each, rate in together))
    drawn = spectrogram_figure(_first(sound, rate, seconds), loudest, highest, rate)
    source = wav_uri(sound[: round(PLAYED_SECONDS * rate)], rate, _peak(together))
    return inlined(drawn, f"sound-{label.replace(' ', '-')}") + audio(source, said)


def _peak(together: list[Sound]) -> float:
    return max(float(np.abs(sound).max()) for sound, _ in together)


def _first(sound: Array, rate: int, seconds: float) -> Array:
    """The first seconds of a sound, followed by silence if it is shorter."""
    count = round(seconds * rate)
    return np.pad(sound[:count], (0, max(0, count - len(sound))))


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
    return section(
        "material", "Material", figure(pictures(shown, "two"), key_of, bar, caption=about)
    )


def _optimisers(results: SoundResults, tables: Tables) -> Section:
    drawn = inlined(plots.optimisers_figure(results.optimisers), "optimisers")
    return section(
        "optimisers",
        "Optimisers",
        plot(drawn, "Cost of the best material so far, by optimiser.", width="narrow"),
        grid(tables["optimisers"]),
        grid(tables["evaluation"]),
    )


def _elsewhere(results: SoundResults) -> Mark:
    """The point without a target."""
    surface = trimesh.Trimesh(
        results.design.surface_vertices, results.design.surface_faces, process=False
    )
    (strike,) = locate_all(surface, [Place(*results.example.elsewhere)], results.design.unit)
    return Mark(ELSEWHERE_CLASS, strike.position, strike.inward)


def _files(results: SoundResults) -> Iterator[tuple[Markup, Markup]]:
    """Files beside the page that are of use elsewhere."""
    descriptions = {
        PROJECT: "the project, for python -m sound design",
        DESIGN: "the design: material, modes, targets, history",
        START: "the same with the uniform material that the search began with",
        TRUTH: "modes of the fine model with the material found",
        "young.npy": "Young’s modulus [Pa] of every voxel, for solver modes --material",
        "optimisers.json": "the optimisers beside each other",
        REACHED: "which modes the solid can have",
    }
    for state, what in STATES.items():
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
