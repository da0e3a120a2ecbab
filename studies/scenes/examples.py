"""The scenes: which solids are where, of what they are, and how they begin to move."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.files.yaml_input import read_own_yaml
from studies.sounds import examples as sounds
from studies.sounds.examples import DESIGN
from workflow.arguments import options

Entry = dict[str, Any]

EXAMPLES = Path(__file__).with_name("examples.yaml")
_STUDIO = Path(__file__).parents[2] / "studio"
PAGE_SOURCES = sorted(
    path
    for folder in ("page", "scene", "standalone")
    for path in (_STUDIO / folder).rglob("*.*")
    if path.suffix in {".js", ".css", ".html"}
)
"""Scripts, styles and frames of which the page of a scene consists."""
FOLDER = "scenes"
"""Folder of the scenes beside the run's configuration."""
SCENE = "scene.yaml"
OUTPUTS = {
    "out": "scene.wav",
    "video": "scene.mp4",
    "gltf": "scene.glb",
    "page": "page.html",
    "impacts": "impacts.csv",
}
"""Options of `studio scene` that name files, and the files."""
TOLD = "scene.json"
"""File with the output of `studio scene --json`."""
SAID = ("title", "seconds", "ground_material", "camera")
"""Keys of a scene's file that its description holds as they are."""
BARS = "builtin:bars"
"""A row of bars, whose scene that command makes itself."""
GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))
"""Turn [rad] from one seed of a sunflower to the next."""
SEMITONES = 12
"""Semitones of an octave."""
DIGITS = 4
"""Digits behind the point of places [m]."""


@dataclass(frozen=True)
class SceneExample:
    """One scene."""

    name: str
    title: str
    figure: str
    about: str
    """Short name, heading, what it follows in the paper, and a sentence."""
    designs: tuple[str, ...] = ()
    """Examples of sound design whose solids are in it, each named once."""
    content: Mapping[str, Any] | None = None
    """Of its file; None if there is none."""
    notes: str = ""
    """Of a row of bars, which needs no file."""

    @property
    def files(self) -> list[str]:
        """Its own file below its folder, if there is one."""
        return [] if self.content is None else [SCENE]


def scenes(config: Mapping[str, Any]) -> dict[str, SceneExample]:
    """The scenes that a configuration asks for, by name."""
    return {name: _scene(name, config) for name in config["scenes"]["examples"]}


def command(scene: SceneExample, folder: str | Path) -> list[str]:
    """What `studio scene` plays for a scene whose file lies in `folder`, as words."""
    if scene.content is None:
        return [BARS, *options({"notes": scene.notes})]
    return [str(Path(folder, SCENE))]


def material_of(density: float) -> str:
    """Material that tells friction, bounce and roughness of a solid of some density [kg/m^3].

    Examples
    --------
    >>> material_of(7800.0), material_of(700.0)
    ('steel', 'wood')
    """
    bounds: dict[str, float] = _described()["materials"]
    return next((name for name, most in bounds.items() if density <= most), list(bounds)[-1])


def _scene(name: str, config: Mapping[str, Any]) -> SceneExample:
    described = _described()["scenes"][name]
    texts = {key: described[key] for key in ("title", "figure", "about")}
    if name not in _MAKERS:
        return SceneExample(name, **texts, notes=config["scenes"]["notes"])
    designs, objects = _MAKERS[name](described, config)
    said = {key: described[key] for key in SAID if key in described}
    content = {**said, "objects": objects}
    return SceneExample(name, **texts, designs=tuple(designs), content=content)


def _falling(described: Entry, config: Mapping[str, Any]) -> tuple[list[str], list[Entry]]:
    """Designs, over and over, on a spiral; the farther from its middle, the higher."""
    count, names = described["count"], config["sound"][sounds.WITHOUT_RECORDINGS]
    chosen = [names[number % len(names)] for number in range(count)]
    # Falls take times that go as the roots of heights, and these shall be equally far apart.
    lowest, highest = np.sqrt(described["heights"])
    heights = np.linspace(lowest, highest, count) ** 2
    places = np.column_stack([spiral(count, described["apart"]), heights])
    objects = [
        {
            **_design(name, config),
            "name": name if number < len(names) else f"{name} {number // len(names) + 1}",
            "position": _rounded(places[number]),
            "rotation": [number * angle % 360 for angle in described["turn"]],
        }
        for number, name in enumerate(chosen)
    ]
    return list(dict.fromkeys(chosen)), objects


def _bowled(described: Entry, config: Mapping[str, Any]) -> tuple[list[str], list[Entry]]:
    """A design, and pins in a triangle whose tip it meets first; bars that are small sound high."""
    listed = config["sound"][sounds.WITHOUT_RECORDINGS]
    name = described["design"] if described["design"] in listed else listed[0]
    pin = {**described["pin"]}
    own = ("size", "height", "semitones", "rotation")
    lowest, height, semitones, rotation = (pin.pop(key) for key in own)
    places = triangle(len(semitones), described["apart"])
    objects = [{**_design(name, config), **described["bowled"]}]
    for number, (place, step) in enumerate(zip(places, semitones), 1):
        size = lowest * 2.0 ** (-step / SEMITONES)
        objects.append(
            {
                "name": f"pin {number}",
                **pin,
                "unit": size,
                "position": _rounded([*place, size * height]),
                # One list each: a file of YAML would else refer from one to another.
                "rotation": list(rotation),
            }
        )
    return [name], objects


_MAKERS: dict[str, Callable[[Entry, Mapping[str, Any]], tuple[list[str], list[Entry]]]] = {
    "falling": _falling,
    "bowled": _bowled,
}
"""Makers of the files of the scenes' objects."""


def _design(name: str, config: Mapping[str, Any]) -> Entry:
    """What is said of the design of an example; scenes lie side by side, two folders deep."""
    example = sounds.examples(config)[name]
    design = Path("..", "..", sounds.FOLDER, example.parts[-1], DESIGN)
    return {"name": name, "design": str(design), "material": material_of(example.density)}


def spiral(count: int, apart: float) -> Array:
    """Points (count, 2) as seeds of a sunflower lie, the nearest two `apart`.

    Examples
    --------
    >>> spiral(2, 0.5).shape
    (2, 2)
    """
    numbers = np.arange(count)
    angles = GOLDEN_ANGLE * numbers
    points = np.sqrt(numbers + 0.5)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    if count < 2:
        return np.asarray(points)
    between = np.linalg.norm(points[:, None] - points, axis=2)[np.triu_indices(count, 1)]
    return np.asarray(points * apart / between.min())


def triangle(count: int, apart: float) -> Array:
    """Points (count, 2) in rows of one, two, three, ... that go on along x, neighbours `apart`.

    Examples
    --------
    >>> triangle(3, 2.0).round(2).tolist()
    [[0.0, 0.0], [1.73, -1.0], [1.73, 1.0]]
    """
    points: list[tuple[float, float]] = []
    row = 0
    while len(points) < count:
        across = apart * (np.arange(row + 1) - row / 2.0)
        points += [(np.sqrt(0.75) * apart * row, float(each)) for each in across]
        row += 1
    return np.array(points[:count])


def _rounded(place: Sequence[float] | Array) -> list[float]:
    return [round(float(each), DIGITS) for each in place]


@cache
def _described() -> dict[str, Any]:
    described: dict[str, Any] = read_own_yaml(EXAMPLES)
    return described
