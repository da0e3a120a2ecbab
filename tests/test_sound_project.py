"""Project files: defaults, paths, and one sentence about each mistake."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from jsonschema import Draft202012Validator

from carillon.errors import UserError
from carillon.fem.geometry import COMPONENTS, FILLS
from carillon.parameters.fields import parameters_of
from carillon.parameters.schema import schema_of
from solver.analysis.problem import DISCRETISATIONS, ProblemOptions
from solver.coarsening.choice import METHODS as COARSENINGS
from sound.clips.wav import write_wav
from sound.design.material import LAWS
from sound.design.optimisers import OPTIMISERS
from sound.design.preparation import prepare
from sound.project.project import Project, load_project, with_optimiser

LEAST = {"mesh": "builtin:bell", "targets": [{"name": "rim", "vertex": 3, "clip": "rim.wav"}]}
SCHEMA = schema_of(Project)


@pytest.fixture
def folder(tmp_path) -> Path:
    for name in ("rim.wav", "top.wav"):
        (tmp_path / name).touch()
    return tmp_path


def write(folder: Path, described: object) -> Path:
    path = folder / "bell.yaml"
    path.write_text(described if isinstance(described, str) else yaml.safe_dump(described))
    return path


def load(folder: Path, **keys: object) -> Project:
    return load_project(write(folder, LEAST | keys))


def test_the_schema_is_one_and_describes_every_key():
    Draft202012Validator.check_schema(SCHEMA)
    Draft202012Validator(SCHEMA).validate(LEAST)
    for part in (SCHEMA, SCHEMA["properties"]["targets"]["items"]):
        assert all(each["description"] for each in part["properties"].values())
        assert part["additionalProperties"] is False


def test_what_a_project_leaves_out_takes_the_defaults_of_the_schema(folder):
    described = load(folder).as_dict()
    for key, part in SCHEMA["properties"].items():
        for inner, each in part.get("properties", {}).items():
            assert described[key][inner] == each["default"]
        if "default" in part and "properties" not in part and key != "coarsen":
            assert described[key] == part["default"]
    assert described["coarsen"] == "ddfem"
    assert load(folder, discretisation="finite-cell").solid.coarsen == "none"


def test_defaults_of_the_solid_are_those_of_the_solver():
    project, solver = parameters_of(Project), parameters_of(ProblemOptions)
    for key in ("unit", "fill", "components", "poisson", "density", "forest"):
        assert project[key].default == solver[key].default
    assert set(SCHEMA["properties"]["fill"]["enum"]) == set(FILLS)
    assert SCHEMA["properties"]["components"]["enum"] == list(COMPONENTS)


def test_choices_of_the_schema_are_those_of_the_code():
    material, optimiser = (SCHEMA["properties"][key] for key in ("material", "optimiser"))
    assert material["properties"]["law"]["enum"] == list(LAWS)
    assert optimiser["properties"]["method"]["enum"] == list(OPTIMISERS)
    assert set(SCHEMA["properties"]["coarsen"]["enum"]) - {"auto"} < set(COARSENINGS)
    assert SCHEMA["properties"]["discretisation"]["enum"] == list(DISCRETISATIONS)


def test_everything_that_is_written_is_read(folder):
    targets = [
        {"name": "rim", "at": [0.088, 0, 0], "clip": "rim.wav", "modes": 20},
        {"name": "top", "vertex": 7, "clip": "top.wav"},
    ]
    project = load(
        folder,
        resolution=16,
        coarsen="none",
        modes=12,
        targets=targets,
        material={"law": "exponential"},
        optimiser={"method": "cma", "seconds": None, "evaluations": 40},
    )
    assert project.solid == ProblemOptions("builtin:bell", 16)
    assert project.modes == 12
    assert [target.name for target in project.targets] == ["rim", "top"]
    assert project.targets[0].at == (0.088, 0, 0) and project.targets[0].modes == 20
    assert project.targets[1].vertex == 7 and project.targets[1].modes is None
    assert project.material.law == "exponential" and project.material.young == 1e9
    assert project.optimiser.method == "cma" and project.optimiser.seconds is None


def test_paths_are_relative_to_the_project(folder, monkeypatch):
    monkeypatch.chdir("/")
    project = load(folder, mesh="models/jug.obj", forest="forests.h5")
    assert project.solid.mesh == str(folder / "models/jug.obj")
    assert project.solid.forest == str(folder / "forests.h5")
    assert project.targets[0].clip == str(folder / "rim.wav")


def test_a_project_as_a_dictionary_is_the_same_project_anywhere(folder, tmp_path):
    project = load(folder, mesh="jug.obj", targets=[LEAST["targets"][0] | {"modes": 4}])
    other = tmp_path / "elsewhere"
    other.mkdir()
    assert load_project(write(other, project.as_dict())) == project


REGIONS = [
    {"name": "body", "material": "iron"},
    {"name": "lid", "material": "brass", "mesh": "lid.stl"},
]


def test_regions_and_supports_are_read_and_written(folder, tmp_path):
    project = load(folder, regions=REGIONS, supports=[{"where": "z < 0.01", "along": "xy"}])
    assert [each.name for each in project.composition.regions] == ["body", "lid"]
    assert project.regions[1].mesh == str(folder / "lid.stl")
    assert project.supports[0].along == "xy"
    assert project.solid == load(folder).solid
    assert load_project(write(tmp_path, project.as_dict())) == project
    Draft202012Validator(SCHEMA).validate(project.as_dict())


@pytest.mark.parametrize("material", ["iron", "beech"])
def test_wood_is_simulated_on_all_voxels_where_it_is_left_to_the_program(folder, material):
    regions = [{"name": "body", "material": material}]
    expected = "ddfem" if material == "iron" else "none"
    assert load(folder, regions=regions).coarsen == expected
    assert load(folder, regions=regions, coarsen="average").coarsen == "average"


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"poisson": 0.3}, "poisson: found 0.3 beside regions"),
        ({"density": 900.0}, "density: found 900 beside regions"),
        ({"material": {"young": 2e9}}, "material.young: found 2e.09 beside regions"),
        ({"regions": [{"name": "a", "material": "irn"}]}, "no material 'irn'.* mean iron"),
        ({"regions": [{"name": "a"}, {"name": "a"}]}, "two regions are called 'a'"),
        ({"regions": [{"material": "iron"}]}, r"regions\[0\]: the key name is missing"),
        ({"supports": [{"mass": 1}]}, r"supports\[0\]: expected where, at or painted"),
    ],
)
def test_regions_that_say_nothing_or_too_much(folder, keys, says):
    with pytest.raises(UserError, match=says) as caught:
        load(folder, **{"regions": REGIONS, **keys})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("number", ["1e9", "1.0e9", "1.0e+9", "1000000000"])
def test_numbers_may_be_written_as_people_do(folder, number):
    text = yaml.safe_dump(LEAST) + f"material: {{young: {number}}}\nmodes: 12.0\n"
    project = load_project(write(folder, text))
    assert project.material.young == 1e9
    assert project.modes == 12 and isinstance(project.modes, int)


def test_points_are_struck_in_the_unit_of_the_mesh(folder):
    places = [
        {"name": "rim", "at": [0.088, 0.0, 0.0], "clip": "rim.wav"},
        {"name": "top", "vertex": 7, "clip": "top.wav"},
    ]
    project = load(folder, unit=2.0, targets=places)
    rim, top = project.strikes(project.surface())
    assert rim.name == "rim" and top.vertex == 7
    assert np.linalg.norm(rim.position - (0.176, 0.0, 0.0)) < 0.02


RIM = LEAST["targets"][0]


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"mseh": "x"}, "there is no key 'mseh', only mesh, .*did you mean mesh?"),
        ({"optimizer": {}}, "no key 'optimizer'.*did you mean optimiser?"),
        (
            {"targets": [{"name": "a", "vertex": 1, "clp": "rim.wav"}]},
            r"targets\[0\] \(a\): .*'clp'.*clip?",
        ),
        ({"weights": {"bark": 1.0}}, "weights: there is no key 'bark', only frequency, amplitude,"),
        ({"targets": [{"name": "a", "vertex": 1}]}, r"targets\[0\] \(a\): the key clip is missing"),
        ({"targets": []}, "targets: found .*expected at least 1 of them"),
        (
            {"targets": [{**RIM, "at": [0, 0, 0]}]},
            r"targets\[0\] \(rim\): expected at or vertex, found both",
        ),
        ({"targets": [{"name": "a", "clip": "rim.wav"}]}, "expected at or vertex, found neither"),
        (
            {"targets": [{"name": "a", "at": [0, 0], "clip": "rim.wav"}]},
            r"\.at \(a\): found \[0, 0\], expected 3 of them",
        ),
        (
            {"targets": [{"name": "a", "at": [0, 0, "x"], "clip": "rim.wav"}]},
            r"\.at\[2\] \(a\): found 'x'",
        ),
        (
            {"targets": [{**RIM, "modes": 0}]},
            r"targets\[0\].modes \(rim\): found 0, expected at least 1",
        ),
        ({"targets": "rim"}, "targets: found 'rim', expected a list"),
        ({"modes": 1}, "modes: found 1, expected at least 2, or auto: elastic modes"),
        ({"modes": "many"}, "modes: found 'many', expected a whole number or auto: elastic modes"),
        ({"modes": "auto\n"}, "modes: found 'auto.n', expected a whole number or auto"),
        ({"modes": None}, "modes: found nothing, expected a whole number or auto: elastic modes"),
        ({"modes": 2.5}, "modes: found 2.5, expected a whole number or auto: elastic modes"),
        ({"mesh": None}, "mesh: found nothing, expected a text"),
        (
            {"coarsen": "fit"},
            "coarsen: found 'fit', expected one of auto, none, average, galerkin, ddfem",
        ),
        ({"poisson": 0.5}, "poisson: found 0.5, expected below 0.5"),
        ({"density": float("nan")}, "density: found nan, expected a finite number"),
        ({"density": 1e300}, "density: found 1e.300, expected at most 1e.06"),
        ({"density": True}, "density: found true, expected a number"),
        ({"density": 10**400}, "density: found 1000"),
        ({"modes": 10**12}, "modes: found 1000000000000, expected at most 10,000, or auto"),
        ({"resolution": 10**9}, "resolution: found 1000000000, expected at most 100,000"),
        ({"unit": 1e300}, "unit: found 1e.300, expected at most"),
        ({"unit": 1e-300}, "unit: found 1e-300, expected at least 1e-12"),
        ({"weights": {"frequency": 0, "amplitude": 0}}, "weights: found 0 for frequency and 0 for"),
        ({"weights": {"frequency": 1e-300, "amplitude": 0}}, "weights: .*1e-12 or more"),
        ({"weights": {"amplitude": 1e300}}, "weights.amplitude: found 1e.300, expected at most"),
        ({"optimiser": {"evaluations": 10**30}}, "optimiser.evaluations: .*expected at most"),
        ({"optimiser": {"seconds": 1e300}}, "optimiser.seconds: .*expected at most 1e.08 s"),
        ({"optimiser": {"workers": 10**6}}, "optimiser.workers: .*expected at most 1,024"),
        ({"optimiser": {"seed": 2**64}}, "optimiser.seed: .*expected at most 4,294,967,294"),
        ({"optimiser": {"population": 10**9}}, "optimiser.population: .*expected at most 10,000"),
        ({"material": {"young": 1e300}}, "material.young: .*expected at most"),
        ({"material": {"young_bounds": [1e9]}}, "material.young_bounds: .*expected 2 of them"),
        ({"material": {"young_bounds": [2e9, 1e9]}}, "young_bounds: .*the lower one first"),
        ({"material": {"poisson_bounds": [0, 0.5]}}, "poisson_bounds.*found 0.5, expected at most"),
        (
            {"coarsen": "none", "material": {"poisson_bounds": [0.3, 0.4]}},
            "expected poisson, which the search starts from, between them; it is 0.25",
        ),
        ({"material": {"dimensions": 10**9}}, "material.dimensions: .*expected at most 10,000"),
        ({"targets": [RIM | {"name": "a\0b"}]}, r"targets\[0\].name: .*can be printed"),
        ({"targets": [RIM | {"name": " "}]}, r"targets\[0\].name: .*not blanks alone"),
        ({"targets": [RIM | {"name": "x" * 101}]}, r"targets\[0\].name: .*at most 100 characters"),
        (
            {"targets": [RIM | {"clip": "x" * 4001}]},
            r"targets\[0\].clip \(rim\): .*at most 4,000 char",
        ),
        (
            {"targets": [RIM | {"vertex": 10**25}]},
            r"targets\[0\].vertex \(rim\): .*expected at most",
        ),
        ({"targets": [dict(RIM) for _ in range(101)]}, "targets: .*expected at most 100 of them"),
        (
            {"targets": [{"name": "a", "at": [10**400, 0, 0], "clip": "rim.wav"}]},
            r"targets\[0\].at\[0\] \(a\): .*expected",
        ),
        ({"optimiser": {"seconds": 0}}, "optimiser.seconds: found 0, expected above 0"),
        ({"optimiser": None}, "optimiser: found nothing, expected keys and values"),
    ],
)
def test_a_mistake_is_answered_in_one_sentence(folder, keys, says):
    with pytest.raises(UserError, match=says) as caught:
        load(folder, **keys)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(str(folder / "bell.yaml"))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("mesh: builtin:bell", "the key targets is missing, expected struck points"),
        ("", "expected a project, keys and values"),
        ("- a\n- b", "expected a project, keys and values"),
        ("mesh: builtin:bell\ntargets: [", "is not readable as YAML .line 2"),
        ("mesh: &a [x]\ntargets: *a", "found the reference"),
        ("[" * 5000, "nested deeper than"),
        ("mesh: !!python/name:os.system x", "could not determine a constructor"),
        ("modes: " + "9" * 5000, "is not readable as YAML"),
        (
            f"{{mesh: a, targets: [{{name: a, clip: b}}], modes: 0x{'f' * 5000}}}",
            "modes: found a whole number of 20,000 bits, expected 4,096 at most",
        ),
        ("modes: 1e400\nmesh: a\ntargets: []", "modes: found inf, expected a whole number or auto"),
        ("mesh: 2020-01-01\ntargets: []", "targets: found"),
        (f"? 0x{'f' * 5000}\n: 1", "found a whole number of 20,000 bits"),
        ("1: 2", "found the key 1, expected a text"),
    ],
)
def test_a_file_that_is_no_project_is_answered_in_one_sentence(folder, text, says):
    with pytest.raises(UserError, match=says) as caught:
        load_project(write(folder, text))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["a/b", "läute 鐘", "-x", "end "])
def test_names_are_plain_text_of_any_kind(folder, name):
    assert load(folder, targets=[RIM | {"name": name}]).targets[0].name == name


def test_faults_of_all_targets_are_told_together(folder):
    """Before any clip is searched, which takes longer."""
    write_wav(folder / "rim.wav", np.sin(np.arange(800.0)) / 2.0, 8000)
    targets = [
        {"name": "rim", "vertex": 3, "clip": "rim.wav"},
        {"name": "rim", "vertex": 4, "clip": "rim.wav"},
        {"name": "gone", "vertex": 5, "clip": "gong.wav"},
        {"name": "zero", "vertex": 6, "clip": "a\0b.wav"},
        {"name": "long", "vertex": 7, "clip": "x" * 300},
        {"name": "empty", "vertex": 8, "clip": "top.wav"},
        {"name": "empty too", "vertex": 9, "clip": "top.wav"},
        {"name": "far", "at": [9.0, 0.0, 0.0], "clip": "rim.wav"},
    ]
    with pytest.raises(UserError) as caught:
        prepare(load(folder, targets=targets))
    starts = ["2 targets are named 'rim'", "target 'gone': ", "target 'zero': ", "target 'long': "]
    starts += ["targets 'empty', 'empty too': ", "target 'far': the point (9, 0, 0) m is"]
    lines = str(caught.value).splitlines()
    assert len(lines) == len(starts) and all(map(str.startswith, lines, starts))
    assert "gong.wav: no such file, expected a sound clip" in lines[1]


def test_settings_from_elsewhere_keep_to_the_schema(folder):
    made = load(folder)
    changed = with_optimiser(made, seconds=None, workers=2, method="cma")
    assert changed.optimiser == replace(made.optimiser, workers=2, method="cma")
    with pytest.raises(UserError, match="workers: found 1000000, expected at most 1,024"):
        with_optimiser(made, workers=10**6)


def test_a_missing_project_is_answered_in_one_sentence(folder):
    with pytest.raises(UserError, match="no such file, expected a project"):
        load_project(folder / "none.yaml")
    with pytest.raises(UserError, match="is a folder, expected a project"):
        load_project(folder)
