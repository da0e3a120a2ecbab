"""A scene: the file that describes solids, how they begin to move, and who hears them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from carillon.builtin_names import BUILTIN_PREFIX
from carillon.errors import UserError
from carillon.files.yaml_input import read_own_yaml, read_yaml
from sound.project.schema import check, with_defaults
from sound.scenes.materials import NamedMaterial, named_material

SCHEMA = Path(__file__).parent / "scene.schema.yaml"
SOURCES = ("design", "modes", "mesh", "radius")
"""What an object may be, one of them."""
FILES = ("design", "modes", "mesh", "heard_modes")
"""Keys of an object that name files."""
STANDARD_MATERIAL = "plastic"
"""Of designs and modes files, for what these do not tell."""
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class ObjectEntry:
    """An object as its scene describes it; see `scene.schema.yaml` for every key.

    One of `design`, `modes`, `mesh` and `radius` is not None.  Files hold in the working directory.
    What an object leaves to its material has the material's values already.
    """

    name: str
    design: str | None
    modes: str | None
    heard_modes: str | None
    mesh: str | None
    radius: float | None
    material: NamedMaterial
    unit: float
    pitch: float | None
    resolution: int
    discretisation: str
    components: str
    count: int
    density: float
    position: Vector
    rotation: Vector
    velocity: Vector
    spin: Vector
    fixed: bool
    friction: float
    restitution: float
    roughness: float
    damping: tuple[float, float]
    collision: str
    level: float
    colour: Vector


@dataclass(frozen=True)
class ListenerEntry:
    """A head at a `position`, or on a `path` of times and places; None leaves it to the camera."""

    position: Vector | None
    facing: Vector | None
    path: tuple[tuple[float, float, float, float], ...] | None


@dataclass(frozen=True)
class CameraEntry:
    """Where the camera is and looks; None leaves it to what there is to see."""

    position: Vector | None
    target: Vector | None
    degrees: float


@dataclass(frozen=True)
class SoundEntry:
    """How a scene sounds."""

    rate: int
    full_scale: float | None
    radiation: bool
    space: bool
    contact_damping: bool
    noise: bool


@dataclass(frozen=True)
class EngineEntry:
    """Duration of the engine's contacts [s], and steps in it."""

    contact_seconds: float
    steps: int

    @property
    def step_seconds(self) -> float:
        """Duration of a step [s]."""
        return self.contact_seconds / self.steps


@dataclass(frozen=True)
class Scene:
    """Solids that move under gravity, above a ground or without.

    Every key is described in `scene.schema.yaml`, which also has the defaults.
    """

    title: str
    seconds: float
    gravity: Vector
    ground: float | None
    ground_material: NamedMaterial
    objects: tuple[ObjectEntry, ...]
    listener: ListenerEntry
    camera: CameraEntry
    sound: SoundEntry
    engine: EngineEntry
    seed: int

    @property
    def files(self) -> list[str]:
        """Files that it is made from."""
        named = [getattr(each, key) for each in self.objects for key in FILES]
        return [name for name in named if name and not name.startswith(BUILTIN_PREFIX)]


@cache
def scene_schema() -> dict[str, Any]:
    """The schema of a scene."""
    loaded: dict[str, Any] = read_own_yaml(SCHEMA)
    return loaded


def load_scene(path: str | Path) -> Scene:
    """Read a scene file (YAML), but none of the files that it names.

    Raises
    ------
    UserError
        With one sentence about the first thing that is wrong with it.
    """
    path = Path(path)
    described = read_yaml(path, "a scene")
    try:
        return scene_of(described, path.parent)
    except UserError as error:
        raise UserError(f"{path}: {error}") from None


def scene_of(described: Mapping[str, Any], folder: Path) -> Scene:
    """The scene that the keys and values of a file in `folder` describe.

    Raises
    ------
    UserError
        With one sentence about the first thing that is wrong.
    """
    check(described, scene_schema())
    filled = with_defaults(described, scene_schema())
    objects = tuple(
        _object(f"objects[{number}]", entry, folder)
        for number, entry in enumerate(filled["objects"])
    )
    twice = [name for name, count in Counter(each.name for each in objects).items() if count > 1]
    if twice:
        raise UserError(f"several objects are named {twice[0]!r}; give each a name of its own")
    sound = filled["sound"]
    scale = sound["full_scale"]
    return Scene(
        filled["title"],
        filled["seconds"],
        _vector(filled["gravity"]),
        filled["ground"],
        _material("ground_material", filled["ground_material"]),
        objects,
        _listener(filled["listener"]),
        CameraEntry(
            _place(filled["camera"]["position"]),
            _place(filled["camera"]["target"]),
            filled["camera"]["degrees"],
        ),
        SoundEntry(**{**sound, "full_scale": None if scale == "auto" else scale}),
        EngineEntry(**filled["engine"]),
        filled["seed"],
    )


def _object(where: str, entry: Mapping[str, Any], folder: Path) -> ObjectEntry:
    given = [key for key in SOURCES if entry[key] is not None]
    if len(given) != 1:
        found = " and ".join(given) or "none of them"
        raise UserError(f"{where}: expected one of {', '.join(SOURCES)}, found {found}")
    if not entry["name"].isprintable() or entry["name"].isspace():
        raise UserError(
            f"{where}.name: found {entry['name']!r}, expected characters that can be printed, and "
            "not blanks alone"
        )
    _require_suiting(where, entry, given[0])
    if entry["material"] is None and given[0] in ("mesh", "radius"):
        raise UserError(f"{where}: a {given[0]} needs a material; name one")
    material = _material(f"{where}.material", entry["material"] or STANDARD_MATERIAL)
    own = {
        key: getattr(material, key) if entry[key] is None else entry[key]
        for key in ("density", "friction", "restitution", "roughness")
    }
    damping = entry["damping"] or (material.alpha, material.beta)
    files = {key: _file(entry[key], folder) for key in FILES}
    vectors = {key: _vector(entry[key]) for key in ("position", "rotation", "velocity", "spin")}
    colour = _vector(entry["colour"] or material.colour)
    return ObjectEntry(
        **{
            **entry,
            **own,
            **files,
            **vectors,
            "material": material,
            "damping": (float(damping[0]), float(damping[1])),
            "colour": colour,
        }
    )


def _require_suiting(where: str, entry: Mapping[str, Any], source: str) -> None:
    """Refuse keys that have no meaning for what an object is."""
    suits = {"unit": ("mesh",), "pitch": ("mesh", "radius"), "density": ("mesh", "radius")}
    suits["heard_modes"] = ("modes",)
    suits["damping"] = ("modes", "mesh", "radius")
    suits["discretisation"] = suits["components"] = ("mesh", "radius")
    standard = scene_schema()["properties"]["objects"]["items"]["properties"]
    for key, sources in suits.items():
        if source not in sources and entry[key] != standard[key]["default"]:
            raise UserError(f"{where}.{key}: goes with {' or '.join(sources)}, found a {source}")
    if entry["pitch"] is not None and entry["count"] == 0:
        raise UserError(
            f"{where}.pitch: goes with a count of modes above 0; what is silent has none"
        )


def _material(where: str, name: str) -> NamedMaterial:
    try:
        return named_material(name)
    except UserError as error:
        raise UserError(f"{where}: {error}") from None


def _listener(entry: Mapping[str, Any]) -> ListenerEntry:
    path = entry["path"]
    if path is None:
        return ListenerEntry(_place(entry["position"]), _place(entry["facing"]), None)
    if entry["position"] is not None:
        raise UserError("listener: expected position or path, found both")
    times = [line[0] for line in path]
    if any(later <= before for before, later in zip(times, times[1:])):
        raise UserError("listener.path: expected times that ascend")
    lines = tuple((float(t), float(x), float(y), float(z)) for t, x, y, z in path)
    return ListenerEntry(None, _place(entry["facing"]), lines)


def _file(name: str | None, folder: Path) -> str | None:
    is_file = name is not None and not name.startswith(BUILTIN_PREFIX)
    return str(folder / name) if is_file and name else name


def _place(values: list[float] | None) -> Vector | None:
    return None if values is None else _vector(values)


def _vector(values: Any) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
