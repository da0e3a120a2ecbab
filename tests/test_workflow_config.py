"""Configuration: schema, defaults, and what is said about mistakes."""

from __future__ import annotations

import copy
import subprocess
import sys
from dataclasses import fields
from importlib import import_module
from pathlib import Path

import pytest
import yaml
from jsonschema import Draft202012Validator

from carillon.errors import UserError
from dataset_gen.settings import ShardOptions
from forests.training.train import TrainingOptions
from solver.analysis.options import SolverOptions
from solver.analysis.problem import ProblemOptions
from solver.response.response_file import StrikeOptions
from studies.benchmark.options import BenchmarkOptions
from studies.scaling.study import ScalingOptions
from workflow import settings, solids

CHECKOUT = Path(__file__).resolve().parent.parent
CONFIGS = CHECKOUT / "workflow" / "config"


def load(name: str) -> dict:
    return yaml.safe_load((CONFIGS / f"{name}.yaml").read_text())


def defaults_of(schema: dict) -> dict:
    """Every default of a schema, nested as in the configuration."""
    found = {}
    for key, part in schema.get("properties", {}).items():
        if part.get("type") == "object" and "properties" in part:
            found[key] = defaults_of(part)
        elif "default" in part:
            found[key] = part["default"]
    return found


def every_key(schema: dict, path: str = "") -> list[tuple[str, dict]]:
    found = []
    parts = dict(schema.get("properties", {}))
    if isinstance(schema.get("additionalProperties"), dict):
        parts["*"] = schema["additionalProperties"]
    for key, part in parts.items():
        found += [(f"{path}{key}", part), *every_key(part, f"{path}{key}.")]
    return found


def test_schema_is_a_schema():
    Draft202012Validator.check_schema(settings.schema())


def test_every_key_has_a_description_and_objects_admit_no_unknown_key():
    for path, part in every_key(settings.schema()):
        assert part.get("description"), f"{path} has no description"
        if part.get("type") == "object":
            assert "additionalProperties" in part, f"{path} admits unknown keys"


def test_default_configuration_states_the_defaults_of_the_schema():
    config = load("laptop")
    del config["models"]
    expected = defaults_of(settings.schema())
    # Which model is shown depends on the models, which have no default.
    for part in ("convergence", "times", "scaling"):
        assert config[part].pop("models")
        expected[part].pop("models")
    assert config["times"].pop("all_methods") and expected["times"].pop("all_methods") is None
    assert config == expected


@pytest.mark.parametrize("name", sorted(path.stem for path in CONFIGS.glob("*.yaml")))
def test_every_configuration_fits_the_schema(name):
    settings.check(load(name))


def test_default_run_needs_no_file_and_four_models_or_more():
    config = load("laptop")
    assert len(config["models"]) >= 4
    assert all(model["mesh"].startswith("builtin:") for model in config["models"].values())


@pytest.mark.parametrize(
    ("keys", "value", "says"),
    [
        (("models", "bell", "resolution"), "fine", ["models.bell.resolution", "voxels"]),
        (("models", "bell", "colour"), "red", ["models.bell", "colour"]),
        (("models", "Big Bell"), {"mesh": "builtin:bell", "resolution": 20}, ["Big Bell"]),
        (("models",), {}, ["models"]),
        (("poisson",), 0.5, ["poisson", "0.5"]),
        (("solver", "modes"), 3, ["solver.modes", "12"]),
        (("solver", "interface"), "loose", ["solver.interface", "overlapping", "free", "fixed"]),
        (("dataset", "objective"), "guess", ["dataset.objective", "hybrid"]),
    ],
)
def test_a_bad_value_is_answered_in_one_sentence(keys, value, says):
    config = copy.deepcopy(load("laptop"))
    target = config
    for key in keys[:-1]:
        target = target[key]
    target[keys[-1]] = value
    with pytest.raises(UserError) as caught:
        settings.check(config)
    message = str(caught.value)
    assert "\n" not in message
    for word in says:
        assert word in message


def test_a_missing_mesh_file_and_an_unknown_model_are_named(tmp_path):
    config = load("meshes")
    config["mesh_folder"] = str(tmp_path)
    with pytest.raises(UserError, match=r"models\.bunny: there is no file .*stanford-bunny\.obj"):
        settings.check_links(config)
    config["models"] = {"bell": config["models"]["bell"]}
    with pytest.raises(UserError, match="'bunny' is not among the models bell"):
        settings.check_links(config)


@pytest.mark.parametrize(
    ("part", "key"),
    [
        ("convergence", "models"),
        ("times", "models"),
        ("times", "all_methods"),
        ("scaling", "models"),
        ("figures", "convergence"),
        ("figures", "scaling"),
    ],
)
def test_lists_of_models_name_models(part, key):
    config = load("laptop")
    config[part][key] = ["gong"]
    with pytest.raises(UserError, match=rf"{part}\.{key}: 'gong' is not among the models"):
        settings.check_links(config)


OPTIONS = {
    "models": (ProblemOptions, StrikeOptions),
    "dataset": (ShardOptions,),
    "forests": (TrainingOptions,),
    "solver": (SolverOptions,),
    "validation": (StrikeOptions,),
    "scaling": (ScalingOptions,),
    "figures": (BenchmarkOptions,),
}
"""Options of commands that a section of the configuration sets by the same names."""
OTHER_DEFAULTS = {
    "models.material": "a homogeneous solid would not show what this is for",
    "dataset.samples": "an option that has to be given",
    "dataset.shards": "two cores make two at once",
    "solver.tolerance": "the option's depends on the method",
    "figures.rough": "the paper has no such figure, but its reader asks",
    "scaling.modes": "a study of a few minutes",
    "scaling.ranks": "a list, since JSON has no tuples",
    "figures.slow_runs": "ARPACK takes minutes a run",
    "figures.tune": "the figures compare with the best that there is",
    "figures.rivals": "an empty list",
}
"""Keys whose default is not that of the option, and why."""


@pytest.mark.parametrize("section", OPTIONS)
def test_keys_that_are_options_have_their_choices_and_defaults(section):
    keys = {
        path.split(".")[-1]: (path, part)
        for path, part in every_key(
            {"properties": {section: settings.schema()["properties"][section]}}
        )
    }
    options = {each.name: each for kind in OPTIONS[section] for each in fields(kind)}
    assert keys.keys() & options.keys()
    for name in keys.keys() & options.keys():
        path, part = keys[name]
        choices = options[name].metadata.get("choices")
        chosen = part["items"] if part.get("type") == "array" else part
        assert choices is None or set(chosen["enum"]) == set(choices), path
        default, own = options[name].default, f"{section}.{name}"
        if "default" in part and own not in OTHER_DEFAULTS:
            assert part["default"] == default, path


def test_materials_are_told_where_a_file_may_be_named():
    schema = settings.schema()["properties"]
    material = schema["models"]["additionalProperties"]["properties"]["material"]["description"]
    assert all(name in material for name in settings.MATERIALS)


LISTS = {
    "discretisation": "solver.analysis.problem:DISCRETISATIONS",
    "fill": "carillon.fem.geometry:FILLS",
    "components": "carillon.fem.geometry:COMPONENTS",
    "material": "carillon.fem.materials:NAMES",
    "materials": "carillon.fem.materials:NAMES",
    "distributions": "dataset_gen.sampling:DISTRIBUTIONS",
    "ranges": "dataset_gen.sampling:DISTRIBUTIONS",
    "objective": "dataset_gen.objectives:DATASET_OBJECTIVES",
    "grower": "forests.training.structure:GROWERS",
    "transform": "forests.scaling:TRANSFORMS",
    "interface": "solver.hcms.condense:INTERFACES",
    "acceleration": "solver.correction.correction:ACCELERATIONS",
    "linear_solver": "solver.linear:METHODS",
    "missed_tolerance": "solver.analysis.options:MISSED",
    "rivals": "studies.benchmark.further:RIVALS",
    "quantity": "studies.objectives.goals:LABELS",
    "solids": "studies.accuracy.solids:SOLIDS",
}
"""Where the code holds what a key of the schema enumerates, by the name of the key."""
EXAMPLES = {
    "sound.examples": "studies/sounds/examples.yaml",
    "sound.recordings": "studies/sounds/examples.yaml",
    "scenes.examples": "studies/scenes/examples.yaml",
}
"""The same of those that are entries of a file."""


def enumerations(part: object, path: tuple[str, ...] = ()) -> list[tuple[str, list[str]]]:
    """Every list of choices in the schema, after the keys that it is of."""
    if isinstance(part, list):
        return [found for each in part for found in enumerations(each, path)]
    if not isinstance(part, dict):
        return []
    here = [(".".join(path), part["enum"])] if "enum" in part else []
    for key, each in part.items():
        inner = part.get("properties") is not None and key == "properties"
        keys = each.items() if inner else [(None, each)]
        for name, below in keys:
            here += enumerations(below, path if name is None else (*path, name))
    return here


@pytest.mark.parametrize(("path", "choices"), enumerations(settings.schema()), ids=str)
def test_every_list_of_the_schema_is_that_of_the_code(path, choices):
    """Snakemake reads the schema by itself, so that it has to hold them, too."""
    name = path.split(".")[-1]
    if path in EXAMPLES:
        entries = yaml.safe_load((CHECKOUT / EXAMPLES[path]).read_text())
        assert set(choices) <= set(entries.get("scenes", entries)), path
        return
    module, _, attribute = LISTS[name].partition(":")
    held = getattr(import_module(module), attribute)
    assert sorted(set(choices) - {"all"}) == sorted(held), path


def test_built_in_solids_are_known_without_loading_what_makes_them():
    from carillon.fem.geometry.builtin import builtin_surface

    for name in settings.BUILTIN_NAMES:
        assert builtin_surface(name).is_volume, name
    with pytest.raises(UserError) as error:
        builtin_surface("gong")
    assert str(error.value).endswith(f"expected one of {', '.join(settings.BUILTIN_NAMES)}")
    program = "import sys, workflow.settings; assert not {'trimesh', 'numba'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", program], check=True)


@pytest.mark.parametrize("section", ["models", *solids.STUDIED])
def test_a_built_in_solid_that_there_is_not_is_named_with_its_key(section):
    config = load("laptop")
    models = config["models"] if section == "models" else config[section]["models"]
    models["gong"] = {**next(iter(models.values())), "mesh": "builtin:gong"}
    where = "models" if section == "models" else f"{section}.models"
    with pytest.raises(UserError, match=rf"{where}\.gong\.mesh: there is no builtin:gong"):
        settings.check_links(config)
