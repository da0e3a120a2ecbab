"""The examples: which solid, which clips at which places, and in which order they are edited."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.builtin_names import BUILTIN_PREFIX
from carillon.files.yaml_input import read_own_yaml
from workflow.arguments import options
from workflow.settings import located

EXAMPLES = Path(__file__).with_name("examples.yaml")
BY_DEFAULT = Path(__file__).with_name("pairs.yaml")
"""File of the settings that all pairs of a recording and a solid share."""
FOLDER = "sound"
"""Folder of the examples beside the run's configuration."""
PROJECT, DESIGN, START, TRUTH = "project.yaml", "design.h5", "start.h5", "truth.h5"
"""Targets, design, what the search began with, modes of the fine model."""
REACHED, COMPARISON = "reach.json", "comparison.json"
"""Modes that a solid can have, optimisers by several seeds."""
SATISFYING_FALL = 0.9
"""Share that a search has to take off a cost for nobody to ask which modes the solid can have."""
ELSEWHERE = "elsewhere"
"""Name of the sound at a point without a target."""
WITHOUT_RECORDINGS, OF_RECORDINGS = LISTS = ("examples", "recordings")
"""Lists of examples in the configuration: without clips of real strikes, and with such clips."""
OF_CLIPS = "clips"
"""List of the pairs that are designed with all defaults."""
ON, SEED = "-on-", "-seed-"
"""In the name of a pair between its recording and its solid, and before a seed."""
BUNNY = "bunny"
RIGID_MODES = 6


@dataclass(frozen=True)
class ExampleTarget:
    """A place, the arguments of `sound clip` for its clip, and the edit that it joins in.

    A `recording` of the list of real ones takes the place of the arguments; the clips of a recorded
    solid have neither. `carillon init` chooses the place if there is none.
    """

    name: str
    at: tuple[float, ...] = ()
    clip: str = ""
    edit: int = 1
    recording: str = ""


@dataclass(frozen=True)
class Recording:
    """A solid whose strikes are the clips."""

    axis: str
    jump: float
    """Coordinate x, y or z, and its value [m], at which the modulus jumps."""
    young: tuple[float, float]
    """Moduli [Pa] below and above it."""
    damping: tuple[float, float]
    """Rayleigh's coefficients of mass [1/s] and stiffness [s]."""

    def moduli(self, centres: Array) -> Array:
        """Moduli (m,) [Pa] of cells with `centres` (m, 3) [m]."""
        above = centres[:, "xyz".index(self.axis)] >= self.jump
        return np.where(above, self.young[1], self.young[0])


@dataclass(frozen=True)
class Example:
    """One example on the solid whose mesh is there."""

    name: str
    title: str
    figure: str
    about: str
    """Short name, heading, what it follows in the paper, and a sentence."""
    mesh: str
    resolution: int
    density: float
    modes: int
    dimensions: int
    seconds: float
    """See `sound.project.project.Project`."""
    targets: tuple[ExampleTarget, ...]
    """In the order of their edits."""
    elsewhere: tuple[str, tuple[float, float, float]]
    """Name and position of a point without a target that is struck, too."""
    compared: bool
    """Whether the optimisers are compared on it."""
    recorded: Recording | None = None
    """What its clips are strikes of; None if they are synthesised."""
    weights: Mapping[str, float] = field(default_factory=dict)
    """Of the cost, those that are not as usual."""
    by_default: bool = False
    """Whether `carillon init` writes its project."""
    search: Mapping[str, int | None] = field(default_factory=dict)
    """Options of `sound design` that its search has."""

    @property
    def edits(self) -> int:
        """Number of designs, each going on from the one before."""
        return max(target.edit for target in self.targets)

    @property
    def mesh_files(self) -> list[str]:
        """Its mesh file; none for a built-in object."""
        return [] if self.mesh.startswith(BUILTIN_PREFIX) else [self.mesh]

    def part(self, edit: int) -> str:
        """Folder of an edit below that of the examples; the last one has none of its own."""
        return self.name if edit == self.edits else f"{self.name}/edit-{edit}"

    @property
    def parts(self) -> list[str]:
        """Folders of all edits."""
        return [self.part(edit) for edit in range(1, self.edits + 1)]

    def edit_of(self, part: str) -> int:
        """Number of the edit whose folder is `part`."""
        return self.parts.index(part) + 1

    def targets_of(self, part: str) -> list[ExampleTarget]:
        """Targets of an edit: its own and those before."""
        edit = self.edit_of(part)
        return [target for target in self.targets if target.edit <= edit]


def examples(config: Mapping[str, Any]) -> dict[str, Example]:
    """The examples and pairs that the lists of a configuration ask for, by name."""
    described = {name: _example(name, config) for key in LISTS for name in config["sound"][key]}
    pairs = dict.fromkeys([*config["sound"][OF_CLIPS], *seeded(config)])
    return described | {name: _pair(name, config) for name in pairs}


def seeded(config: Mapping[str, Any]) -> list[str]:
    """Names of the pair that is designed by several seeds, by seed; the first has none."""
    name, seeds = config["sound"]["seeded_clip"], config["sound"]["clip_seeds"]
    return [name, *(f"{name}{SEED}{seed}" for seed in range(1, seeds))]


def project(example: Example, part: str, config: Mapping[str, Any]) -> dict[str, Any]:
    """Content of the project file of an edit; its paths are relative to the folder `part`."""
    folder = Path(config["results_dir"], FOLDER, part)
    clips = Path(config["results_dir"], FOLDER, example.name, "clips")
    return {
        "mesh": example.mesh if not example.mesh_files else os.path.relpath(example.mesh, folder),
        "resolution": example.resolution,
        "density": example.density,
        "modes": example.modes,
        "targets": [
            {
                "name": target.name,
                "at": list(target.at),
                "clip": os.path.relpath(clips / f"{target.name}.wav", folder),
            }
            for target in example.targets_of(part)
        ],
        "material": {"dimensions": example.dimensions},
        "weights": dict(example.weights),
        "optimiser": {"seconds": example.seconds, "seed": config["sound"]["seed"]},
    }


def solid_arguments(example: Example) -> list[str]:
    """Arguments of `solver modes` for the fine model of an example, but for its material."""
    how = {
        "resolution": example.resolution,
        "density": example.density,
        "modes": RIGID_MODES + example.modes,
    }
    return [example.mesh, *options(how)]


def _example(name: str, config: Mapping[str, Any]) -> Example:
    described, sound = _described(EXAMPLES)[name], config["sound"]
    meshes = [_mesh(solid["mesh"], config) for solid in described["solids"]]
    there = (mesh.startswith(BUILTIN_PREFIX) or Path(mesh).is_file() for mesh in meshes)
    chosen = list(there).index(True)
    solid = described["solids"][chosen]
    places = solid["places"]
    targets = [
        ExampleTarget(at=tuple(places[each["name"]]), **each) for each in described["targets"]
    ]
    texts = {key: described[key] for key in ("title", "figure", "about", "density", "dimensions")}
    return Example(
        name=name,
        **texts,
        mesh=meshes[chosen],
        resolution=sound["resolution"] or solid["resolution"],
        modes=sound["modes"] or described["modes"],
        seconds=sound["seconds"] or described["seconds"],
        targets=tuple(targets),
        elsewhere=(solid["elsewhere"]["name"], tuple(solid["elsewhere"]["at"])),
        compared=described.get("compared", False),
        recorded=Recording(**described["recorded"]) if "recorded" in described else None,
        weights=described.get("weights", {}),
    )


def _pair(name: str, config: Mapping[str, Any]) -> Example:
    pair, _, seed = name.partition(SEED)
    recording, _, solid = pair.partition(ON)
    described = dict(_described(BY_DEFAULT))
    elsewhere = described.pop("elsewhere")[solid]
    sound = config["sound"]
    return Example(
        name=name,
        title=f"{recording} on {solid}".replace("-", " ").capitalize(),
        **described,
        mesh=f"{BUILTIN_PREFIX}{solid}",
        targets=(ExampleTarget(recording, recording=recording),),
        elsewhere=(elsewhere["name"], tuple(elsewhere["at"])),
        compared=False,
        by_default=True,
        search={
            "evaluations": sound["clip_evaluations"],
            "seed": sound["seed"] + int(seed or 0) or None,
        },
    )


def _mesh(mesh: str, config: Mapping[str, Any]) -> str:
    return located(config, config["sound"]["bunny"] if mesh == BUNNY else mesh)


@cache
def _described(file: Path) -> dict[str, Any]:
    return read_own_yaml(file)
