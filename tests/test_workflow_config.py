"""Configuration: keys, defaults, and what is said about mistakes."""

import copy
import re
from importlib import import_module
from pathlib import Path

import pytest
import snakemake.utils
import yaml

from carillon.builtin_names import BUILTIN_NAMES
from carillon.errors import UserError
from carillon.parameters import REQUIRED
from carillon.parameters.fields import parameters_of
from dataset_gen.settings import ShardOptions
from forests.training.options import TrainingOptions
from solver.analysis.options import SolverOptions
from solver.analysis.problem import ProblemOptions
from solver.response.response_file import StrikeOptions
from studies.base import catalogue
from studies.benchmark.options import BenchmarkOptions
from studies.scaling.runs import ScalingOptions
from tests.configuration_keys import every_key, every_value
from tests.programs import CHECKOUT, python
from workflow import settings, solids
from workflow.configuration.whole import completed, limits

CONFIGS = CHECKOUT / "workflow" / "config"


NAMES = sorted(path.stem for path in CONFIGS.glob("*.yaml"))


def load(name: str) -> dict:
    return settings.complete([CONFIGS / f"{name}.yaml"])


def test_every_key_has_a_description():
    for place, each in every_key():
        assert each.meaning or each.domain.kind.__doc__, f"{place} has no description"


@pytest.mark.parametrize("name", NAMES)
def test_equal_configurations_have_equal_hashes(name):
    """Whether defaults are written out or not."""
    config = load(name)
    again = completed(config)
    assert again == config
    assert settings.config_hash(again) == settings.config_hash(config)


def test_a_configuration_file_does_not_copy_what_jobs_may_take():
    for name in NAMES:
        assert "resources" not in yaml.safe_load((CONFIGS / f"{name}.yaml").read_text())
    given = {"find_modes": {"minutes": 7}, "grow_tree": {"memory_mb": 5}}
    resources = completed({**load("tiny"), "resources": given})["resources"]
    own = limits()
    assert resources["find_modes"] == {"memory_mb": own["find_modes"].memory_mb, "minutes": 7}
    assert resources["grow_tree"] == {"memory_mb": 5, "minutes": own["grow_tree"].minutes}
    with pytest.raises(UserError, match="resources: no rule 'find_mods' takes any; did you mean"):
        completed({**load("tiny"), "resources": {"find_mods": {"minutes": 7}}})


def test_limits_are_those_of_the_rules():
    """Every rule takes its own from the table, and none stands there for nothing."""
    rules = [*CHECKOUT.glob("workflow/rules/*.smk"), *CHECKOUT.glob("studies/*/*.smk")]
    taken = {name for file in rules for name in re.findall(r'limits\("(\w+)"', file.read_text())}
    taken |= {f"rate_{study.name}" for study in catalogue.of_cases()}
    assert taken == set(limits())


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
        completed(config)
    message = str(caught.value)
    assert "\n" not in message
    for word in says:
        assert word in message


def test_a_missing_mesh_file_and_an_unknown_model_are_named(tmp_path):
    config = load("meshes")
    config["mesh_folder"] = str(tmp_path)
    with pytest.raises(UserError, match=r"models\.bunny\.mesh: .* no file .*stanford-bunny\.obj"):
        settings.check_files(config)
    config["models"] = {"bell": config["models"]["bell"]}
    with pytest.raises(UserError, match="'bunny' is not among the models bell"):
        completed(config)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            {"models": {"bell": {"material": "smoth"}}},
            "c.yaml, line 5: models.bell.material: found 'smoth', expected a file or uniform, ",
        ),
        ({"models": {"bell": {"material": "smoth"}}}, " (did you mean smooth?); there is no file "),
        (
            {"models": {"bell": {"mesh": "nope.obj"}}},
            "c.yaml, line 4: models.bell.mesh: found 'nope.obj', expected a file or builtin:NAME; "
            "there is no file meshes/nope.obj; put it there, or set mesh_folder",
        ),
        ({"models": {"bell": {"mesh": "bel"}}}, "NAME (did you mean builtin:bell?); there is"),
        ({"forests": {"model": "a.h5"}}, "c.yaml, line 9: forests.model: there is no file a.h5"),
        (
            {"dataset": {"ranges": {"unifrm": [0, 1]}}},
            "c.yaml, line 12: dataset.ranges.unifrm: 'unifrm' is not among the distributions "
            "uniform, log-uniform (did you mean uniform?)",
        ),
        ({"solver": None}, "c.yaml, line 7: solver: found nothing, expected keys and values"),
        ({"title": False}, "c.yaml, line 1: title: found false, as YAML reads no and off without"),
    ],
)
def test_what_a_file_names_wrongly_is_told_with_line_and_key(tmp_path, monkeypatch, change, says):
    config = {
        "title": "t",
        "models": {"bell": {"mesh": "builtin:bell", "material": "smooth", "resolution": 20}},
        "solver": {},
        "forests": {"model": "default"},
        "dataset": {"ranges": {}},
    }
    snakemake.utils.update_config(config, change)
    monkeypatch.chdir(tmp_path)
    Path("c.yaml").write_text(yaml.safe_dump(config, sort_keys=False))
    with pytest.raises(UserError, match=re.escape(says)):
        settings.check_files(settings.complete(["c.yaml"]), ["c.yaml"])


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
        completed(config)


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
    prefix = "models.NAME" if section == "models" else section
    keys = {
        place.rpartition(".")[2]: each
        for place, each in every_key()
        if place.rpartition(".")[0] == prefix
    }
    options = {
        name: each for kind in OPTIONS[section] for name, each in parameters_of(kind).items()
    }
    assert keys.keys() & options.keys()
    for name in keys.keys() & options.keys():
        domain, own = keys[name].domain, options[name].domain
        chosen = domain.items[0] if domain.kind is tuple else domain
        assert not own.choices or set(chosen.choices) == set(own.choices), name
        if keys[name].default is not REQUIRED and f"{section}.{name}" not in OTHER_DEFAULTS:
            assert keys[name].default == options[name].default, name


LISTS = {
    "discretisation": "solver.analysis.problem:DISCRETISATIONS",
    "fill": "carillon.fem.geometry:FILLS",
    "components": "carillon.fem.geometry:COMPONENTS",
    "grower": "forests.training.growers:GROWERS",
    "transform": "forests.scaling:TRANSFORMS",
    "interface": "solver.hcms.condense:INTERFACES",
    "acceleration": "solver.correction.criteria:ACCELERATIONS",
    "linear_solver": "solver.linear:METHODS",
    "missed_tolerance": "solver.analysis.options:MISSED",
    "rivals": "studies.benchmark.further_rivals:RIVALS",
    "quantity": "studies.objectives.goals:LABELS",
    "accuracy.solids": "studies.accuracy.solids:SOLIDS",
    "thin_walls.solids": "studies.thin_walls.solids:SOLIDS",
}
"""Where the code holds the choices of a key, by its place or its name."""


def held_choices(place: str) -> str | None:
    place = place.rstrip("[]")
    return LISTS.get(place, LISTS.get(place.rpartition(".")[2]))


CHOICES = [
    (place, domain.choices)
    for place, domain in every_value()
    if domain.choices and held_choices(place)
]


@pytest.mark.parametrize(("place", "choices"), CHOICES, ids=str)
def test_every_list_of_choices_is_that_of_the_code(place, choices):
    """They are written out where the code that has them takes long to load."""
    module, _, attribute = str(held_choices(place)).partition(":")
    held = getattr(import_module(module), attribute)
    assert sorted(set(choices) - {"all"}) == sorted(held), place


def test_built_in_solids_are_known_without_loading_what_makes_them():
    from carillon.fem.geometry.builtin import builtin_surface

    for name in BUILTIN_NAMES:
        assert builtin_surface(name).is_volume, name
    with pytest.raises(UserError) as error:
        builtin_surface("gong")
    assert str(error.value).endswith(f"expected one of {', '.join(BUILTIN_NAMES)}")


def test_planning_loads_no_library_that_computes():
    """Every job of a cluster plans before it begins."""
    program = (
        "import sys; from studies.base import catalogue; from workflow import settings\n"
        f"settings.complete([{str(CONFIGS / 'tiny.yaml')!r}]); catalogue.all_studies()\n"
        "print({'petsc4py', 'numba', 'trimesh', 'mpi4py.MPI', 'matplotlib'} & set(sys.modules))"
    )
    done = python("-c", program, check=True)
    assert done.stdout == "set()\n"


@pytest.mark.parametrize("section", ["", *solids.studied(load("laptop"))])
def test_a_built_in_solid_that_there_is_not_is_named_with_its_key(section):
    config = load("laptop")
    models = (config[section] if section else config)["models"]
    models["gong"] = {**next(iter(models.values())), "mesh": "builtin:gong"}
    where = f"{section}.models" if section else "models"
    with pytest.raises(UserError, match=rf"{where}\.gong\.mesh: builtin:gong: no such built-in"):
        completed(config)
