"""The section of an example's page that lets one hear it, point by point."""

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure
from numpy.typing import NDArray

from solver.response.response import spectrogram
from sound.rendering.listening import Listening
from sound.rendering.render import residual_share
from sound.rendering.solid import SoundingSolid
from studies.base.media import highest_hertz, inlined, spectrogram_figure, wav_uri
from studies.base.page import Section, section
from studies.base.parts import (
    article,
    audio,
    div,
    facts,
    figure,
    grid,
    html,
    place,
    plot,
    prose,
    styled,
)
from studies.base.table import Table
from studies.sounds import plots
from studies.sounds.examples import ELSEWHERE
from studies.sounds.pictures import Mark
from studies.sounds.results import CLIPS, SoundResults

Array = NDArray[np.float64]
Sound = tuple[Array, int]

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


def sounds(
    results: SoundResults, tables: dict[str, Table], marks: list[Mark], elsewhere: Mark
) -> Section:
    """Every struck point with its sounds, and the point without a target."""
    design, name = results.design, results.example.elsewhere[0]
    missed = Listening.of_design(design, SoundingSolid.of_design(design)).missed
    points = [
        _point(results, mark, share, plots.balance_figure(tables["amplitudes"], point), number)
        for number, (point, mark, share) in enumerate(zip(design.targets.names, marks, missed))
    ]
    rest = _panel(results, "after", ELSEWHERE, [results.sound("after", ELSEWHERE)], name)
    return section(
        "Sounds",
        prose(SOUNDS),
        grid(tables["distances"]),
        grid(tables["loudness"]),
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
