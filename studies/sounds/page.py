"""The page of an example: targets and design, to see and to hear."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import trimesh
import yaml
from numpy.typing import NDArray

from solver.response.response import spectrogram
from sound.rendering.listening import Listening
from sound.rendering.render import residual_share
from sound.rendering.solid import SoundingSolid
from sound.strikes import Place, locate_all
from studies.base.media import embedded, highest_hertz, inlined, spectrogram_figure, wav_uri
from studies.base.page import rendered
from studies.base.table import Table
from studies.sounds import plots
from studies.sounds.examples import DESIGN, ELSEWHERE, PROJECT, REACHED, START, TRUTH
from studies.sounds.pictures import ELSEWHERE_CLASS, Mark, marks_of, material_pictures
from studies.sounds.results import CLIPS, MODES, SoundResults

Array = NDArray[np.float64]
Sound = tuple[Array, int]

SHOWN_SECONDS, PLAYED_SECONDS = 1.0, 2.0
"""Longest time of a spectrogram and of a player."""
DIGITS = 6
"""Of coordinates after the point."""
ROOM_ABOVE = 1.5
"""Highest frequency of a spectrogram over that of the highest target."""
SHOWN_HERTZ = 8000.0
"""Up to which the spectrograms of modes alone show those of the clip at least."""
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
"""What is shown of modes alone, and names for people."""


def page(results: SoundResults, tables: dict[str, Table]) -> str:
    """Build the page of an example from its tables and files."""
    example, design = results.example, results.design
    marks = marks_of(design)
    elsewhere = _elsewhere(results)
    frequencies = plots.frequency_figure(tables["frequencies"], tables["truth"])
    compared = plots.optimisers_figure(results.optimisers) if results.optimisers else None
    return rendered(
        "studies/sounds/page.html.j2",
        title=example.title,
        example=example,
        design=design,
        tables=tables,
        edits=tables["designs"].rows,
        worst=_worst(tables["frequencies"]),
        points=_points(results, marks, tables["amplitudes"]),
        elsewhere=elsewhere,
        rest=_panel(results, "after", ELSEWHERE, [results.sound("after", ELSEWHERE)]),
        cost=inlined(plots.cost_figure(results), "cost"),
        frequencies=inlined(frequencies, "frequencies"),
        optimisers=compared and inlined(compared, "optimisers"),
        pictures=[embedded(each) for each in material_pictures(design, [*marks, elsewhere])],
        colour_bar=inlined(plots.colour_bar(design.young), "colours"),
        moduli=(design.young.min(), np.median(design.young), design.young.max()),
        files=_files(results),
        project=yaml.safe_dump(design.settings, sort_keys=False),
    )


def _worst(frequencies: Table) -> dict[str, float]:
    """Largest differences [bark] from the targets before and after."""
    return {
        state: max(abs(row[f"{state}_bark"]) for row in frequencies.rows)
        for state in ("start", "found")
    }


def _points(results: SoundResults, marks: list[Mark], balance: Table) -> list[dict[str, Any]]:
    """Sounds and balance of every struck point."""
    design = results.design
    names = design.targets.names
    missed = Listening.of_design(design, SoundingSolid.of_design(design)).missed
    return [
        {
            "name": name,
            "style": mark.style,
            "missed": missed[number],
            "position": np.round(mark.position / results.design.unit, DIGITS).tolist(),
            "panels": _panels(results, name),
            "alone": _modes_panels(results, name),
            "balance": inlined(plots.balance_figure(balance, name), f"balance-{number}"),
        }
        for number, (name, mark) in enumerate(zip(names, marks))
    ]


def _panels(results: SoundResults, name: str) -> list[dict[str, Any]]:
    """Sounds at a point before and after, and its clip, on the same scales."""
    sounds = [results.sound(state, name) for state in STATES]
    return [_panel(results, state, name, sounds) for state in STATES]


def _panel(results: SoundResults, state: str, name: str, together: list[Sound]) -> dict[str, Any]:
    """Spectrogram and players of a sound, scaled as those that are shown `together`."""
    sound, rate = results.sound(state, name)
    target = (sound, rate) if name == ELSEWHERE else results.sound(CLIPS, name)
    highest = min(highest_hertz(together), ROOM_ABOVE * results.design.targets.frequencies[-1])
    seen = _seen(f"{state}-{name}", (sound, rate), target, together, float(highest))
    panel = {"state": STATES[state], **seen}
    if state == CLIPS:
        return panel
    modes = results.modes_alone(state, name)
    return panel | {
        "modes": wav_uri(modes[: round(PLAYED_SECONDS * rate)], rate, _peak(together)),
        "residual_share": residual_share(modes, sound - modes),
    }


def _modes_panels(results: SoundResults, name: str) -> list[dict[str, Any]]:
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
    return [
        {
            "state": ALONE[state],
            **_seen(f"alone-{state}-{name}", sound, clip, together, highest),
        }
        for state, sound in sounds.items()
    ]


def _seen(
    label: str, own: Sound, target: Sound, together: list[Sound], highest: float
) -> dict[str, Any]:
    """Spectrogram up to `highest` [Hz], below the loudest of the target, and player of a sound."""
    sound, rate = own
    loudest = float(spectrogram(*target)[2].max())
    seconds = min(SHOWN_SECONDS, max(len(each) / rate for each, rate in together))
    figure = spectrogram_figure(_first(sound, rate, seconds), loudest, highest, rate)
    return {
        "plot": inlined(figure, f"sound-{label.replace(' ', '-')}"),
        "source": wav_uri(sound[: round(PLAYED_SECONDS * rate)], rate, _peak(together)),
    }


def _peak(together: list[Sound]) -> float:
    return max(float(np.abs(sound).max()) for sound, _ in together)


def _first(sound: Array, rate: int, seconds: float) -> Array:
    """The first seconds of a sound, followed by silence if it is shorter."""
    count = round(seconds * rate)
    return np.pad(sound[:count], (0, max(0, count - len(sound))))


def _elsewhere(results: SoundResults) -> Mark:
    """The point without a target."""
    surface = trimesh.Trimesh(
        results.design.surface_vertices, results.design.surface_faces, process=False
    )
    (strike,) = locate_all(surface, [Place(*results.example.elsewhere)], results.design.unit)
    return Mark(ELSEWHERE_CLASS, strike.position, strike.inward)


def _files(results: SoundResults) -> list[dict[str, Any]]:
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
    return [
        {"name": name, "what": what, "bytes": results.file(name).stat().st_size}
        for name, what in descriptions.items()
        if results.file(name).is_file()
    ]
