"""The configuration: one file describes a run, the schema fills in what it leaves out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from jsonschema.exceptions import ValidationError
from snakemake.utils import update_config, validate

from carillon.builtin_names import BUILTIN_NAMES, BUILTIN_PREFIX
from carillon.errors import UserError
from carillon.fem.materials import NAMES as MATERIALS
from carillon.files.yaml_input import read_own_yaml, read_yaml
from carillon.records import provenance
from dataset_gen.objectives import OBJECTIVES, require_objective
from forests import default as default_forests
from workflow import training
from workflow.arguments import path_word
from workflow.disk_space import require_place
from workflow.strict_schema import first_mistake, reason

PLACES = ("results_dir", "mesh_folder", "baseline")
"""Keys that say where something lies, on which no result depends."""
NO_RESULT = ("baseline", "resources")
"""Keys that describe no run: what it is compared with, and what its jobs may take."""
DEFAULT_FORESTS = "default"
"""Name of the forests that come with the package."""
FOLDER = Path(__file__).resolve().parent
"""Of the rules and all that belongs to them."""
SCHEMA = FOLDER / "schemas" / "config.schema.yaml"
CONFIGURATION = "a configuration"


@cache
def schema() -> dict[str, Any]:
    """The JSON schema of the configuration, which nobody changes."""
    loaded: dict[str, Any] = read_own_yaml(SCHEMA)
    return loaded


def read(files: Iterable[str | Path], given: Mapping[str, Any]) -> dict[str, Any]:
    """A configuration from its files and from what the command line gives beside them.

    Snakemake reads the same files, but takes 1e-3 for text, 2020-01-01 for a date, the last of
    several equal keys, and what is there once for a million times.

    Parameters
    ----------
    files
        Later ones take precedence.
    given
        Values that take precedence over all files.

    Raises
    ------
    UserError
        If a file cannot be read, see `carillon.files.yaml_input.read_yaml`.
    """
    config: dict[str, Any] = {}
    for values in (*(read_yaml(file, CONFIGURATION) for file in files), given):
        update_config(config, values)
    return config


def check(config: Mapping[str, Any]) -> None:
    """Check a configuration before any rule is built from it.

    Raises
    ------
    UserError
        With one sentence about the first value that does not fit.
    """
    mistake = first_mistake(schema(), config)
    if mistake is not None:
        raise UserError(_sentence(mistake))


def complete(files: Iterable[str | Path]) -> dict[str, Any]:
    """A configuration from its files, checked and with its defaults; meshes may be absent.

    Raises
    ------
    UserError
        If it cannot be read, or holds anything that does not fit.
    """
    config = read(files, {})
    check(config)
    validate(config, str(SCHEMA))
    return config


def resolved(config: Mapping[str, Any]) -> dict[str, Any]:
    """What describes a run; what it is compared with and what its jobs may take does not."""
    return {key: value for key, value in config.items() if key not in NO_RESULT}


def config_hash(config: Mapping[str, Any]) -> str:
    """Short hash of a resolved configuration, wherever its files lie."""
    return provenance.config_hash(
        {key: value for key, value in resolved(config).items() if key not in PLACES}
    )


def check_links(config: Mapping[str, Any]) -> None:
    """Check what a schema cannot say: names and files that a complete configuration refers to.

    Raises
    ------
    UserError
        If a model's mesh or material or the forests do not exist, a list of models names none,
        `objectives.objectives` names no objective, or training data make no sense.
    """
    require_place(Path(config["results_dir"]), "results_dir")
    for where, models in _solids(config):
        for name, model in models.items():
            require_known_mesh(f"{where}.{name}.mesh", model["mesh"])
    for name in config["models"]:
        for path in model_files(config, name):
            if not Path(path).is_file():
                raise UserError(
                    f"models.{name}: there is no file {path}; put it there, or set mesh_folder to "
                    "the folder that holds it"
                )
    for part in ("convergence", "times", "scaling"):
        _require_models(f"{part}.models", config[part]["models"], config["models"])
    _require_models(
        "times.all_methods", config["times"]["all_methods"] or (), config["times"]["models"]
    )
    for part in ("convergence", "scaling"):
        figures = config["figures"]
        _require_models(f"figures.{part}", figures[part], figures["models"])
    forests = forests_file(config)
    if forests is not None and not Path(forests).is_file():
        raise UserError(
            f"forests.model: there is no file {forests}; name one that python -m forests train "
            f"wrote, {DEFAULT_FORESTS} for those of the package, or null to train some"
        )
    for plan in (training.own(config), training.default(config)):
        plan.check()
    training.check_study(config)
    for name in studied_objectives(config):
        try:
            require_objective(name)
        except UserError as error:
            raise UserError(f"objectives.objectives: {error}") from None


def require_known_mesh(where: str, mesh: str) -> None:
    """Raise UserError unless a mesh that is called built-in is one, as the key `where` says."""
    if mesh.startswith(BUILTIN_PREFIX) and mesh.removeprefix(BUILTIN_PREFIX) not in BUILTIN_NAMES:
        raise UserError(
            f"{where}: there is no {mesh}, expected a file or {BUILTIN_PREFIX}NAME with "
            f"{', '.join(BUILTIN_NAMES)}"
        )


def mesh_of(config: Mapping[str, Any], model: str, section: str | None = None) -> str:
    """Mesh argument of the solver: `builtin:NAME` or the path of a file.

    Of a model of the run, or of one that a section of the configuration has of its own.
    """
    models = (config[section] if section else config)["models"]
    return located(config, models[model]["mesh"])


def material_of(config: Mapping[str, Any], model: str) -> str:
    """Material argument of the solver: a name or the path of a file."""
    material: str = config["models"][model]["material"]
    return material if material in MATERIALS else _in_mesh_folder(config, material)


def model_files(config: Mapping[str, Any], model: str) -> list[str]:
    """Files that a model is made from; none for a built-in object with a named material."""
    mesh, material = mesh_of(config, model), material_of(config, model)
    files = [] if mesh.startswith(BUILTIN_PREFIX) else [mesh]
    return files if material in MATERIALS else [*files, material]


def forests_file(config: Mapping[str, Any]) -> str | None:
    """Forests to coarsen by that are there already; None if the run trains its own.

    Raises
    ------
    UserError
        If no forests come with the package, but are wanted.
    """
    named: str | None = config["forests"]["model"]
    if named == DEFAULT_FORESTS:
        return _forests_of_package()
    return None if named is None else path_word(named)


def own_shards(config: Mapping[str, Any]) -> list[str]:
    """Names of the run's training data; none if it trains no forests."""
    return [] if config["forests"]["model"] else training.own(config).shards


def studied_objectives(config: Mapping[str, Any]) -> list[str]:
    """Names of the objectives that the study compares."""
    return list(config["objectives"]["objectives"] or OBJECTIVES)


def forest_files(named: str | None = None) -> list[str]:
    """File of the forests that are named, or else of those of the package; none without either."""
    try:
        return [path_word(named) if named else _forests_of_package()]
    except UserError:
        return []


def _forests_of_package() -> str:
    """Their file; relative within a checkout, so that results name no folder of a machine."""
    file, here = default_forests.default_path(), Path.cwd()
    return str(file.relative_to(here) if file.is_relative_to(here) else file)


def _solids(config: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Solids by name, of the run and of every section that has some of its own, after its key."""
    yield "models", config["models"]
    for section, part in config.items():
        models = part.get("models") if isinstance(part, Mapping) and section != "models" else None
        if isinstance(models, Mapping):
            yield f"{section}.models", models


def _require_models(where: str, names: Iterable[str], models: Iterable[str]) -> None:
    known = list(models)
    for name in names:
        if name not in known:
            raise UserError(f"{where}: {name!r} is not among the models {', '.join(known)}")


def located(config: Mapping[str, Any], mesh: str) -> str:
    """Mesh argument of the solver: `builtin:NAME`, or the path of a file below mesh_folder."""
    return mesh if mesh.startswith(BUILTIN_PREFIX) else _in_mesh_folder(config, mesh)


def _in_mesh_folder(config: Mapping[str, Any], path: str) -> str:
    return path_word(Path(config["mesh_folder"]) / path)


def _sentence(mistake: ValidationError) -> str:
    where = ".".join(str(part) for part in mistake.absolute_path) or "configuration"
    meant = mistake.schema.get("description") if isinstance(mistake.schema, dict) else None
    return f"{where}: {reason(mistake)}" + (f"; expected: {_lower(meant)}" if meant else "")


def _lower(text: str) -> str:
    return text[0].lower() + text[1:].rstrip(".")
