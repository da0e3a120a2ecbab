"""The configuration: one file describes a run, `workflow.configuration` what it leaves out."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast

from carillon.builtin_names import BUILTIN_NAMES, BUILTIN_PREFIX
from carillon.errors import UserError
from carillon.fem.materials import NAMES as MATERIALS
from carillon.files.yaml_input import nearest, read_marked, read_yaml
from carillon.parameters.sentences import ParameterError, Place, alike
from carillon.records import provenance
from forests import default as default_forests
from workflow import training
from workflow.arguments import path_word
from workflow.configuration.whole import Values, completed
from workflow.disk_space import require_place

PLACES = ("results_dir", "mesh_folder", "baseline")
"""Keys that say where something lies, on which no result depends."""
NO_RESULT = ("baseline", "resources")
"""Keys that describe no run: what it is compared with, and what its jobs may take."""
DEFAULT_FORESTS = "default"
"""Name of the forests that come with the package."""
FOLDER = Path(__file__).resolve().parent
"""Folder of the rules and all that belongs to them."""
CONFIGURATION = "a configuration"


def complete(files: Iterable[str | Path], given: Values = MappingProxyType({})) -> dict[str, Any]:
    """A configuration from its files and from what the command line gives beside them.

    It is checked and has its defaults; meshes may be absent. Snakemake reads the same files, but
    takes 1e-3 for text, 2020-01-01 for a date, the last of several equal keys, and what is there
    once for a million times.

    Raises UserError if a file cannot be read, see `carillon.files.yaml_input.read_yaml`; or with
    one sentence about the first value that does not fit, and the line that it is in.

    Parameters
    ----------
    files
        Later ones take precedence.
    given
        Values that take precedence over all files.
    """
    from snakemake.utils import update_config

    files = list(files)
    config: dict[str, Any] = {}
    for values in (*(read_yaml(file, CONFIGURATION) for file in files), given):
        update_config(config, values)
    with _mistakes_in_lines(files, given):
        return completed(config)


@contextmanager
def _mistakes_in_lines(files: Iterable[str | Path], given: Values) -> Iterator[None]:
    """Begin sentences about values with the file and the line that they are in."""
    try:
        yield
    except ParameterError as error:
        raise UserError(f"{_where(error.place, files, given)}{error}") from None


def _where(place: Place, files: Iterable[str | Path], given: Values) -> str:
    """Beginning of a sentence: where the value at a place was written last."""
    places = [(0, "")]
    for file in files:
        steps, line = nearest(read_marked(file, CONFIGURATION)[1], place)
        places.append((steps, f"{file}, line {line}: "))
    steps, part = 0, cast("Any", given)
    while steps < len(place) and isinstance(part, Mapping) and place[steps] in part:
        steps, part = steps + 1, part[place[steps]]
    if steps:
        places.append((steps, "--config: "))
    return sorted(places, key=lambda each: each[0])[-1][1]


def resolved(config: Mapping[str, Any]) -> dict[str, Any]:
    """What describes a run; what it is compared with and what its jobs may take does not."""
    return {key: value for key, value in config.items() if key not in NO_RESULT}


def config_hash(config: Mapping[str, Any]) -> str:
    """Short hash of a resolved configuration, wherever its files lie."""
    return provenance.config_hash(
        {key: value for key, value in resolved(config).items() if key not in PLACES}
    )


def check_files(
    config: Mapping[str, Any],
    files: Iterable[str | Path] = (),
    given: Values = MappingProxyType({}),
) -> None:
    """Check that a run can write, and read what its complete configuration names.

    `files` and `given` are what the configuration was made from, see `complete`. Raises UserError
    if the folder of the results cannot be written, or a model's mesh or material or the forests do
    not exist.
    """
    require_place(Path(config["results_dir"]), "results_dir")
    with _mistakes_in_lines(files, given):
        for name in config["models"]:
            _check_files_of(config, name)
        for name in config["times"]["models"]:
            _check_plain(config, name)
        forests = forests_file(config)
        if forests is not None and not Path(forests).is_file():
            raise ParameterError(
                ("forests", "model"),
                f"there is no file {forests}; name one that carillon train wrote, "
                f"{DEFAULT_FORESTS} for those of the package, or null to train some",
            )


def _check_files_of(config: Mapping[str, Any], name: str) -> None:
    model = config["models"][name]
    known = {
        "mesh": {each: f"{BUILTIN_PREFIX}{each}" for each in BUILTIN_NAMES},
        "material": {each: each for each in MATERIALS},
    }
    for key, path in _files_by_key(config, name).items():
        if Path(path).is_file():
            continue
        meant = alike(model[key], known.get(key, {}))
        hint = f" (did you mean {known[key][meant]}?)" if meant else ""
        others = {
            "mesh": "a file or builtin:NAME",
            "material": f"a file or {', '.join(MATERIALS)}",
            "regions": "a file",
        }
        raise ParameterError(
            ("models", name, key),
            f"found {model[key]!r}, expected {others[key]}{hint}; there is no file {path}; put it "
            "there, or set mesh_folder to the folder that holds it",
        )
    for path in _files_of_regions(config, name):
        if not Path(path).is_file():
            raise ParameterError(
                ("models", name, "regions"), f"a region is from {path}, which is no file"
            )


def _check_plain(config: Mapping[str, Any], name: str) -> None:
    if config["models"][name]["fix"] or described_by(config, name):
        raise ParameterError(
            ("times", "models"),
            f"{name} is of several regions, or held; methods are timed on free solids of one "
            "Poisson's ratio, so leave it out",
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
    return [*_files_by_key(config, model).values(), *_files_of_regions(config, model)]


def regions_of(config: Mapping[str, Any], model: str) -> str | None:
    """File of a model's regions and of what holds it; None if it is of one material, and free."""
    named = config["models"][model]["regions"]
    return None if named is None else _in_mesh_folder(config, named)


def described_by(config: Mapping[str, Any], model: str) -> str | None:
    """File that tells a model's regions: that of the regions, or a mesh that is made of some."""
    mesh = mesh_of(config, model)
    return regions_of(config, model) or (mesh if Path(mesh).suffix in (".yaml", ".yml") else None)


def _files_of_regions(config: Mapping[str, Any], model: str) -> list[str]:
    """Files that the file of a model's regions names."""
    file = described_by(config, model)
    if file is None or not Path(file).is_file():
        return []
    from workflow.composition import files_of  # Its import takes long.

    return files_of(file)


def _files_by_key(config: Mapping[str, Any], model: str) -> dict[str, str]:
    mesh, material = mesh_of(config, model), material_of(config, model)
    files = {} if mesh.startswith(BUILTIN_PREFIX) else {"mesh": mesh}
    files |= {} if material in MATERIALS else {"material": material}
    regions = regions_of(config, model)
    return files if regions is None else {**files, "regions": regions}


def forests_file(config: Mapping[str, Any]) -> str | None:
    """Forests to coarsen by that are there already; None if the run trains its own.

    Raises UserError if no forests come with the package, but are wanted.
    """
    named: str | None = config["forests"]["model"]
    if named == DEFAULT_FORESTS:
        return _forests_of_package()
    return None if named is None else path_word(named)


def own_shards(config: Mapping[str, Any]) -> list[str]:
    """Names of the run's training data; none if it trains no forests."""
    return [] if config["forests"]["model"] else training.own(config).shards


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


def located(config: Mapping[str, Any], mesh: str) -> str:
    """Mesh argument of the solver: `builtin:NAME`, or the path of a file below mesh_folder."""
    return mesh if mesh.startswith(BUILTIN_PREFIX) else _in_mesh_folder(config, mesh)


def _in_mesh_folder(config: Mapping[str, Any], path: str) -> str:
    return path_word(Path(config["mesh_folder"]) / path)
