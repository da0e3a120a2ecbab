"""A project: the file that describes a sound design."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from carillon.builtin_names import BUILTIN_PREFIX
from carillon.errors import UserError
from carillon.files.yaml_input import read_yaml
from solver.analysis.problem import ProblemOptions
from sound.project.schema import check, project_schema, with_defaults
from sound.strikes import Place, Strike, locate_all
from sound.surface import struck_surface

if TYPE_CHECKING:
    import trimesh

_SOLID = (
    "mesh",
    "resolution",
    "unit",
    "fill",
    "components",
    "poisson",
    "density",
    "coarsen",
    "forest",
    "discretisation",
)
LEAST_WEIGHT = 1e-12
"""Of frequencies or of amplitudes: what is smaller leaves a search with nothing to lower."""


@dataclass(frozen=True)
class TargetEntry:
    """A struck point, `at` a position (3,) [mesh unit] or a `vertex`, and the clip it sounds like.

    `modes` are taken from the clip, its strongest; None takes all that it has.  Of these, modes at
    the frequencies `without` [Hz] are left out.  It may be clipped if that is allowed.
    """

    name: str
    clip: str
    at: tuple[float, float, float] | None
    vertex: int | None
    modes: int | None
    allow_clipped: bool
    without: tuple[float, ...] = ()


@dataclass(frozen=True)
class MaterialSettings:
    """Modulus to start from [Pa], eigenvectors that make the field, and how they do.

    `young_bounds` [Pa] are those that moduli are brought into by another density, `poisson_bounds`
    those that Poisson's ratio is sought between; None leaves these as they are.
    """

    young: float
    dimensions: int
    law: str
    young_bounds: list[float] | None
    poisson_bounds: list[float] | None


@dataclass(frozen=True)
class DampingSettings:
    """What modes are damped by when they sound, and regions that have loss factors of their own."""

    source: str
    regions: int


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
    fine_check: bool


@dataclass(frozen=True)
class Project:
    """A solid, targets at points of its surface, and how a material is sought.

    Every key is described in `project.schema.yaml`, which also has the defaults.  Paths are
    no longer relative to the project's file: they hold in the working directory.  `modes` is a
    number once the clips are known, see `sound.design.preparation`.
    """

    solid: ProblemOptions
    modes: int | Literal["auto"]
    targets: tuple[TargetEntry, ...]
    material: MaterialSettings
    damping: DampingSettings
    weights: Weights
    optimiser: OptimiserSettings

    def as_dict(self) -> dict[str, Any]:
        """The project as its file has it, with all defaults and its paths as they are here."""
        described = asdict(self)
        solid = described.pop("solid")
        described["targets"] = [asdict(target) for target in self.targets]
        for target in described["targets"]:
            target["at"] = None if target["at"] is None else list(target["at"])
            target["without"] = list(target["without"])
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
            If one is far from the surface, or two are at one place; see `sound.strikes`.
        """
        places = [Place(target.name, target.at, target.vertex) for target in self.targets]
        return locate_all(surface, places, self.solid.unit)


def load_project(path: str | Path) -> Project:
    """Read a project file (YAML), but none of the files that it names.

    Raises
    ------
    UserError
        With one sentence about the first thing that is wrong with it.
    """
    path = Path(path)
    described = read_yaml(path, "a project")
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
    check(described, project_schema())
    filled = with_defaults(described, project_schema())
    targets = tuple(_target(number, each, folder) for number, each in enumerate(filled["targets"]))
    _require_something_to_lower(filled["weights"])
    for key in ("young_bounds", "poisson_bounds"):
        _require_ascending(f"material.{key}", filled["material"][key])
    solid = {key: filled[key] for key in _SOLID}
    if not solid["mesh"].startswith(BUILTIN_PREFIX):
        solid["mesh"] = str(folder / solid["mesh"])
    if solid["forest"] is not None:
        solid["forest"] = str(folder / solid["forest"])
    options = ProblemOptions(**solid)
    _require_free(options, filled["material"]["poisson_bounds"])
    return Project(
        options,
        filled["modes"],
        targets,
        MaterialSettings(**filled["material"]),
        DampingSettings(**filled["damping"]),
        Weights(**filled["weights"]),
        OptimiserSettings(**filled["optimiser"]),
    )


def with_optimiser(project: Project, **given: Any) -> Project:
    """The project with other settings of its optimiser; those that are None stay as they are.

    Raises
    ------
    UserError
        If one is beyond what the schema allows.
    """
    changes = {key: value for key, value in given.items() if value is not None}
    check(changes, project_schema()["properties"]["optimiser"])
    return replace(project, optimiser=replace(project.optimiser, **changes))


def _target(number: int, entry: Mapping[str, Any], folder: Path) -> TargetEntry:
    at, vertex = entry["at"], entry["vertex"]
    if (at is None) == (vertex is None):
        given = "neither" if at is None else "both"
        raise UserError(f"targets[{number}]: expected at or vertex, found {given}")
    name = entry["name"]
    if name.isspace() or not name.isprintable():
        raise UserError(
            f"targets[{number}].name: found {name!r}, expected characters that can be printed, and "
            "not blanks alone"
        )
    clip = str(folder / entry["clip"])
    places = {"at": None if at is None else tuple(at), "without": tuple(entry["without"])}
    return TargetEntry(**{**entry, "clip": clip, **places})


def _require_ascending(key: str, bounds: list[float] | None) -> None:
    if bounds is not None and not bounds[0] < bounds[1]:
        raise UserError(f"{key}: found {bounds}, expected the lower one first")


def _require_free(solid: ProblemOptions, bounds: list[float] | None) -> None:
    """Refuse bounds of a Poisson's ratio that the forests fix, or that is not between them."""
    if bounds is None:
        return
    if solid.coarsen == "ddfem":
        raise UserError(
            "material.poisson_bounds: found coarsen ddfem, whose forests hold for one Poisson's "
            "ratio; choose coarsen none or average, or discretisation finite-cell"
        )
    if not bounds[0] < solid.poisson < bounds[1]:
        raise UserError(
            f"material.poisson_bounds: found {bounds}, expected poisson, which the search starts "
            f"from, between them; it is {solid.poisson:g}"
        )


def _require_something_to_lower(weights: Mapping[str, float]) -> None:
    if max(weights["frequency"], weights["amplitude"]) < LEAST_WEIGHT:
        raise UserError(
            f"weights: found {weights['frequency']:g} for frequency and {weights['amplitude']:g} "
            f"for amplitude, expected at least one of them to be {LEAST_WEIGHT:g} or more"
        )
