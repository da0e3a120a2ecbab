"""A project: the file that describes a sound design."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml
from jsonschema import Draft202012Validator

from carillon.errors import UserError
from solver.geometry.surface import BUILTIN_PREFIX
from solver.problem import ProblemOptions
from sound.strikes import Place, Strike, locate_all
from sound.surface import struck_surface

if TYPE_CHECKING:
    import trimesh
    from jsonschema.exceptions import ValidationError

SCHEMA = Path(__file__).parent / "project.schema.yaml"
_SOLID = ("mesh", "resolution", "unit", "fill", "pieces", "poisson", "density", "coarsen", "forest")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)[eE][-+]?[0-9]+$")
_TYPES = {
    "array": "a list",
    "boolean": "true or false",
    "integer": "a whole number",
    "null": "null",
    "number": "a number",
    "object": "keys and values",
    "string": "a text",
}
_RULES = {
    "minimum": "at least {}",
    "exclusiveMinimum": "above {}",
    "exclusiveMaximum": "below {}",
    "minItems": "at least {} of them",
    "maxItems": "at most {} of them",
    "minLength": "a text",
}


@dataclass(frozen=True)
class TargetEntry:
    """A struck point, `at` a position (3,) [mesh unit] or a `vertex`, and the clip it sounds like.

    `modes` are taken from the clip, its strongest; None takes all that it has.
    """

    name: str
    clip: str
    at: tuple[float, float, float] | None = None
    vertex: int | None = None
    modes: int | None = None


@dataclass(frozen=True)
class MaterialSettings:
    """Modulus to start from [Pa], eigenvectors that make the field, and how they do."""

    young: float
    dimensions: int
    law: str


@dataclass(frozen=True)
class Weights:
    """Weights of the parts of the cost (Eq. 4)."""

    frequency: float
    amplitude: float
    regulariser: float


@dataclass(frozen=True)
class OptimiserSettings:
    """How the material is sought; None leaves it to the method, or sets no limit."""

    method: str
    seconds: float | None
    evaluations: int | None
    seed: int
    population: int | None
    workers: int | None


@dataclass(frozen=True)
class Project:
    """A solid, targets at points of its surface, and how a material is sought.

    Every key is described in `project.schema.yaml`, which also has the defaults.  Paths are
    no longer relative to the project's file: they hold in the working directory.
    """

    solid: ProblemOptions
    modes: int
    targets: tuple[TargetEntry, ...]
    material: MaterialSettings
    weights: Weights
    optimiser: OptimiserSettings

    def as_dict(self) -> dict[str, Any]:
        """The project as its file has it, with all defaults and its paths as they are here."""
        described = asdict(self)
        solid = described.pop("solid")
        described["targets"] = [asdict(target) for target in self.targets]
        for target in described["targets"]:
            target["at"] = None if target["at"] is None else list(target["at"])
        return {key: solid[key] for key in _SOLID} | described

    def surface(self) -> trimesh.Trimesh:
        """Surface that is struck, in metres.

        Raises
        ------
        UserError
            If there is no such mesh.
        """
        return struck_surface(self.solid.mesh, self.solid.unit)

    def strikes(self, surface: trimesh.Trimesh) -> list[Strike]:
        """The targets' points on `surface`, which `Project.surface` made.

        Raises
        ------
        UserError
            If one is not on the surface, or two are at one place; see `sound.strikes`.
        """
        return locate_all(surface, [self._place_of(target) for target in self.targets])

    def _place_of(self, target: TargetEntry) -> Place:
        if target.at is None:
            return Place(target.name, vertex=target.vertex)
        return Place(target.name, at=[self.solid.unit * x for x in target.at])


def load_project(path: str | Path) -> Project:
    """Read a project file (YAML).

    Raises
    ------
    UserError
        With one sentence about the first thing that is wrong with it.
    """
    path = Path(path)
    try:
        described = yaml.load(path.read_text(encoding="utf-8"), _Loader)
    except FileNotFoundError:
        raise UserError(f"{path}: no such file, expected a project (YAML)") from None
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise UserError(f"{path}: is not readable as YAML ({_first_line(error)})") from None
    if not isinstance(described, dict):
        raise UserError(f"{path}: expected keys and values such as mesh: builtin:bell")
    try:
        return project_of(described, path.parent)
    except UserError as error:
        raise UserError(f"{path}: {error}") from None


def project_of(described: Mapping[str, Any], folder: Path) -> Project:
    """The project that the keys and values of a file in `folder` describe.

    Raises
    ------
    UserError
        With one sentence about the first thing that is wrong.
    """
    _check(described)
    filled = _with_defaults(described, _schema())
    targets = tuple(_target(number, each, folder) for number, each in enumerate(filled["targets"]))
    _require_distinct([target.name for target in targets])
    solid = {key: filled[key] for key in _SOLID}
    if not solid["mesh"].startswith(BUILTIN_PREFIX):
        solid["mesh"] = str(folder / solid["mesh"])
    if solid["forest"] is not None:
        solid["forest"] = str(folder / solid["forest"])
    return Project(
        ProblemOptions(**solid),
        filled["modes"],
        targets,
        MaterialSettings(**filled["material"]),
        Weights(**filled["weights"]),
        OptimiserSettings(**filled["optimiser"]),
    )


class _Loader(yaml.SafeLoader):
    """Reads 1e9 and 1.0e9 as numbers, as YAML 1.2 does; PyYAML by itself takes them for text."""


_Loader.add_implicit_resolver("tag:yaml.org,2002:float", _FLOAT, list("-+.0123456789"))


@cache
def _schema() -> dict[str, Any]:
    loaded: dict[str, Any] = yaml.safe_load(SCHEMA.read_text(encoding="utf-8"))
    return loaded


def _target(number: int, entry: Mapping[str, Any], folder: Path) -> TargetEntry:
    at, vertex = entry["at"], entry["vertex"]
    if (at is None) == (vertex is None):
        found = "neither" if at is None else "both"
        raise UserError(f"targets[{number}]: expected at or vertex, found {found}")
    clip = folder / entry["clip"]
    if not clip.is_file():
        raise UserError(f"targets[{number}].clip: there is no file {clip}; name a WAV file")
    return TargetEntry(**{**entry, "clip": str(clip), "at": None if at is None else tuple(at)})


def _require_distinct(names: Sequence[str]) -> None:
    for number, name in enumerate(names):
        if name in names[:number]:
            first = names.index(name)
            raise UserError(
                f"targets[{first}] and targets[{number}] are both named {name!r}; give each a name "
                "of its own"
            )


def _with_defaults(value: Any, schema: Mapping[str, Any]) -> Any:
    """The value, completed by the defaults of the schema."""
    if isinstance(value, list) and "properties" in schema.get("items", {}):
        return [_with_defaults(item, schema["items"]) for item in value]
    if "properties" not in schema:
        # A number such as 30.0 is a whole one to the schema.
        whole = isinstance(value, float) and "integer" in schema.get("type", "")
        return int(value) if whole else value
    return {
        key: _with_defaults(value.get(key, part.get("default")), part)
        for key, part in schema["properties"].items()
    }


def _check(described: Mapping[str, Any]) -> None:
    mistakes = list(Draft202012Validator(_schema()).iter_errors(described))
    # A key with a typing error often is also one that is missed: the former says more.
    mistakes.sort(key=lambda mistake: mistake.validator != "additionalProperties")
    if mistakes:
        raise UserError(_sentence(mistakes[0]))
    _require_finite(described, ())


def _require_finite(value: Any, path: tuple[str | int, ...]) -> None:
    if isinstance(value, float) and not math.isfinite(value):
        raise UserError(f"{_place(path)}: found {value}, expected a finite number")
    parts = value.items() if isinstance(value, dict) else []
    for key, part in enumerate(value) if isinstance(value, list) else parts:
        _require_finite(part, (*path, key))


def _sentence(mistake: ValidationError) -> str:
    where = _place(mistake.absolute_path)
    about = f"{where}: " if where else ""
    known = mistake.schema.get("properties", {})
    if mistake.validator == "additionalProperties":
        wrong = next(str(key) for key in mistake.instance if key not in known)
        close = difflib.get_close_matches(wrong, known, n=1)
        hint = f"; did you mean {close[0]}?" if close else ""
        return f"{about}there is no key {wrong!r}, only {', '.join(known)}{hint}"
    if mistake.validator == "required":
        key = next(key for key in mistake.validator_value if key not in mistake.instance)
        return f"{about}the key {key} is missing, expected {_meaning(known[key])}"
    meaning = _meaning(mistake.schema)
    return f"{about}found {mistake.instance!r}, expected {_expected(mistake)}: {meaning}"


def _expected(mistake: ValidationError) -> str:
    """What would fit the rule that was broken."""
    value = mistake.validator_value
    if mistake.validator == "type":
        return " or ".join(_TYPES[kind] for kind in ([value] if isinstance(value, str) else value))
    if mistake.validator == "enum":
        return f"one of {', '.join(value)}"
    return _RULES[mistake.validator].format(value)


def _meaning(schema: Mapping[str, Any]) -> str:
    """Description of a key, to go on a sentence."""
    text = str(schema["description"])
    return text[0].lower() + text[1:]


def _place(path: Iterable[str | int]) -> str:
    """Name of a value, such as targets[0].clip."""
    parts = [f"[{part}]" if isinstance(part, int) else f".{part}" for part in path]
    return "".join(parts).removeprefix(".")


def _first_line(error: Exception) -> str:
    """What went wrong, and where in the file."""
    mark = getattr(error, "problem_mark", None)
    reason = getattr(error, "problem", None) or str(error).splitlines()[0]
    return reason if mark is None else f"line {mark.line + 1}: {reason}"
