"""What people write into configurations and names reaches no shell and fills no memory."""

import copy
import json
import runpy
import shlex
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml

from carillon.errors import UserError
from carillon.fem.geometry import builtin_surface
from carillon.parameters import Check
from forests.evaluate import MOST_BLOCKS
from forests.layout import MOST_LEAVES
from studies.blocks.database import MOST_MATERIALS
from studies.scaling import launch
from tests.configuration_keys import every_key, every_value
from tests.workflow_runs import CHECKOUT, LAPTOP, snakemake
from workflow import settings
from workflow.arguments import options, path_word, quoted
from workflow.configuration.whole import completed
from workflow.submission import require_plain

LINT = runpy.run_path(str(CHECKOUT / ".ci" / "lint_rules.py"))
MODEL = {"mesh": "builtin:bar", "resolution": 16}
HOSTILE = (
    *("my box.obj", "a'b\"c.obj", "$(touch x).obj", "`touch x`;touch y&.obj", "ünï – 模.obj"),
    *("*?[ab].obj", "a\\b.obj", "#a.obj", "a|b.obj", " a .obj", "a=b:c,d%.obj"),
)
"""Names that a shell, argparse or Snakemake might take for more than names."""


CONFIG = settings.complete([LAPTOP])


def changed(place: str, value: Any) -> dict[str, Any]:
    """The default configuration with another value at a place such as models.bell.mesh."""
    config = copy.deepcopy(CONFIG)
    *sections, key = place.split(".")
    part = config
    for section in sections:
        part = part[section]
    part[key] = value
    return config


def refusal(config: dict[str, Any]) -> str:
    with pytest.raises(UserError) as caught:
        completed(config)
    message = str(caught.value)
    assert len(message.splitlines()) == 1 and len(message) <= 1200
    return message


# Words -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_names_are_single_words_for_a_shell(name):
    for place in ("models.bell.mesh", "models.bell.material", "results_dir", "mesh_folder"):
        completed(changed(place, name))
    assert settings.mesh_of(changed("models.bell.mesh", name), "bell") == f"meshes/{name}"
    assert shlex.split(quoted(shlex.join(["mpiexec", name]))) == ["mpiexec", name]


def test_no_path_is_taken_for_an_option():
    config = changed("models.bell.mesh", "-n.obj")
    assert settings.mesh_of(config, "bell") == "meshes/-n.obj"
    config["mesh_folder"] = ""
    config["models"]["bell"]["material"] = "--seed"
    config["forests"]["model"] = "-f.h5"
    assert settings.mesh_of(config, "bell") == "./-n.obj"
    assert settings.material_of(config, "bell") == "./--seed"
    assert settings.forests_file(config) == "./-f.h5"
    assert path_word("./-a") == path_word("-a") == "./-a"
    assert "begins with a hyphen" in refusal(changed("results_dir", "./-results"))


def test_options_leave_out_what_has_no_value_and_keep_zero():
    assert options({"corrections": 0, "retained_modes": None, "tune": False, "weak": True}) == [
        *("--corrections", "0", "--weak")
    ]


def test_every_placeholder_of_every_rule_is_quoted():
    """`snakemake --lint` asks this of all rules, see test_rules_lint; here what it asks."""
    unquoted = LINT["unquoted"]
    assert unquoted("run {params.mesh} > {log:q} {threads} {input.a:q} {resources.mpi}") == [
        "params.mesh"
    ]
    assert unquoted("run '{output}' {params.x!r} {wildcards.a}") == [
        *("output", "params.x", "wildcards.a")
    ]
    lints = list(LINT["_demand_quotes"](None, SimpleNamespace(shellcmd="cat {input}")))
    assert [lint.title for lint in lints] == ["Placeholder {input} without quotes"]


@pytest.mark.nightly
def test_a_run_with_hostile_names_runs_nothing_but_its_rules(tmp_path):
    """From the mesh's name over the launcher of two ranks to the folder of the results."""
    mesh, folder = "-my 'box' $(touch x) \"`touch y`;touch z&*.obj", "my $(touch r) 'results'; [a]"
    meshes = tmp_path / "mesh es"
    meshes.mkdir()
    builtin_surface("bar").export(meshes / "plain.obj")
    (meshes / "plain.obj").rename(meshes / mesh)
    config = {
        "results_dir": folder,
        "mesh_folder": "mesh es",
        "models": {"bar": {"mesh": mesh, "resolution": 8}},
        "solver": {
            "modes": 12,
            "ranks": 2,
            "launcher": "mpiexec --oversubscribe -x 'A=$(touch l)'",
        },
        "forests": {"model": "default"},
    }
    configfile = tmp_path / "of $(touch c).yaml"
    configfile.write_text(yaml.safe_dump(config, allow_unicode=True))
    target = f"{folder}/models/bar/hcms.h5"
    done = snakemake(tmp_path, "--cores", 2, "--configfile", configfile.name, "--", target)
    log = tmp_path / folder / "logs" / "models" / "bar" / "hcms.log"
    assert done.returncode == 0, done.stderr + (log.read_text() if log.exists() else "")
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"mesh es", configfile.name, folder, ".snakemake"}
    assert (tmp_path / target).is_file()


# Refusals ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("a{b}", "placeholders"),
        ("<a>", "placeholders"),
        ("a\nb", "line break"),
        ("a\x00b", "control character"),
        ("a\x1b[2Jb", "control character"),
        ("a\u2028b", "line break"),
        ("\ud800", "half a character"),
        ("x" * 201, "a name of more than 200 bytes"),
        ("ü" * 101, "a name of more than 200 bytes"),
        ("ab/" * 400, "longer than 1,000 bytes"),
        ("", "expected a text"),
    ],
)
def test_names_that_nothing_can_be_called_are_refused(name, says):
    places = ("results_dir", "models.bell.mesh", "models.bell.material", "forests.model")
    for place in places:
        message = refusal(changed(place, name))
        assert message.startswith(f"{place}: ") and says in message


@pytest.mark.parametrize("name", ["bar\n", "Bar", "a b", "-a", "a;b", "{a}", "a" * 65, "", 7, None])
def test_models_have_plain_names(name):
    for part in ("models", "figures.models"):
        assert refusal(changed(part, {name: MODEL})).startswith(f"{part}: ")


@pytest.mark.parametrize("text", ["a\nb", "\x00", "\x1b[31m", "x" * 201, "\udfff"])
def test_titles_are_one_line(text):
    for place in ("title", "models.bell.title"):
        assert refusal(changed(place, text)).startswith(f"{place}: ")


@pytest.mark.parametrize("command", ["mpiexec 'a", "mpiexec\nls", "", " ", "x" * 1001])
def test_a_launcher_is_a_command(command):
    assert refusal(changed("solver.launcher", command)).startswith("solver.launcher: ")


@pytest.mark.parametrize(
    "value",
    [float("nan"), float("inf"), -float("inf"), 1e300, 10**400, True],
    ids=lambda value: str(value)[:5],
)
def test_numbers_are_finite_and_within_bounds(value):
    for place in numbers():
        assert refusal(changed(place, value)).startswith(f"{place}: ")


def numbers() -> Iterator[str]:
    """Places of plain numbers in the default configuration."""
    for place, each in every_key():
        named = place.replace("resources.NAME", "resources.find_modes").replace("NAME", "bell")
        solid = named.split(".models.bell")[0]
        there = ".models.bell" not in named or "bell" in CONFIG[solid]["models"]
        if each.domain.kind in (int, float) and "[]" not in named and there:
            yield named


def test_every_number_has_bounds_and_every_text_a_form():
    for place, domain in every_value():
        if domain.kind in (int, float):
            assert {"le", "lt"} & set(domain.limits), f"{place} has no upper bound"
            assert {"ge", "gt"} & set(domain.limits), f"{place} has no lower bound"
        if domain.kind is str and not domain.choices:
            marks = getattr(domain.annotation, "__metadata__", ())
            assert any(isinstance(mark, Check) for mark in marks), f"{place} may hold any text"


def test_bounds_are_those_of_the_commands():
    bounds = {place: domain.limits.get("le") for place, domain in every_value()}
    for place, most in {
        "scaling.ranks[]": launch.MOST_RANKS,
        "figures.ranks[]": launch.MOST_RANKS,
        "forests.blocks": MOST_BLOCKS,
        "forests_study.blocks": MOST_BLOCKS,
        "forests_study.timed_blocks": MOST_BLOCKS,
        "forests.materials": MOST_MATERIALS,
    }.items():
        assert bounds[place] == most, place
    for place in ("forests.max_leaves", "default_forest.forests.max_leaves"):
        assert bounds[place] <= MOST_LEAVES


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("models.bell.resolution", 10**9),
        ("models.bell.resolution", 16.5),
        ("solver.modes", 10**30),
        ("solver.ranks", 1_000_000),
        ("solver.cores", 1_000_000),
        ("figures.ranks", [1, 1_000_000]),
        ("dataset.samples", 10**30),
        ("dataset.seed", 2**64),
        ("forests.max_leaves", 10**10),
        ("dataset.workers", 10**6),
        ("models.bell.material", True),
        ("models.bell.material", 1),
        ("models.bell.strike", [0.0, float("nan"), 0.0]),
        ("dataset.ranges", {"uniform": [1.0, float("inf")]}),
        ("figures.convergence", [1, "a"] * 10_000),
    ],
)
def test_what_no_machine_could_do_is_refused(place, value):
    assert refusal(changed(place, value)).startswith(place)


# Files -------------------------------------------------------------------------------------------

BOMB = "\n".join(
    [
        "a0: &a0 {k: [x, x, x, x, x, x, x, x, x]}",
        *(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 9)),
        "models: *a8",
    ]
)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (BOMB, "the reference *a0"),
        ("models: " + 5000 * "[" + 5000 * "]", "nested deeper"),
        ("models: " + 5000 * "{a: ", "nested deeper"),
        ("title: a\ntitle: b", "the key title is there twice"),
        ("title: !!python/complex 1+2j", "python/complex"),
        ("title: !!python/name:os.system", "python/name"),
        ("poisson: " + 5000 * "1", "digits"),
        ("- a", "expected a configuration"),
        ("", "expected a configuration"),
        ("title: [", "line 1"),
        ("a\tb: {", "line 1"),
        ("#" + 2**20 * "x", "longer than"),
        (b"\xff\xfe\x00", "not readable"),
        (b"RIFF\x24\x00\x00\x80WAVEfmt ", "not readable"),
    ],
)
def test_files_that_are_no_configurations_are_refused(tmp_path, text, says):
    path = tmp_path / "config.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(UserError) as caught:
        settings.complete([path])
    assert says in str(caught.value)
    assert len(str(caught.value)) <= 1200 and len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    "name", ["absent.yaml", ".", "/dev/null", "x" * 5000, "a\0b", "/proc/self/mem"]
)
def test_names_that_hold_no_configuration_are_refused(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match="expected a configuration"):
        settings.complete([name])


def test_files_and_values_of_the_command_line_take_precedence_in_their_order(tmp_path):
    first, second = tmp_path / "first.yaml", tmp_path / "second.yaml"
    first.write_text(
        "solver: {modes: 20, tolerance: 1e-5}\nmodels: {a: {resolution: 8}}\ntitle: t\n"
    )
    second.write_text("solver: {modes: 30}\nmodels: {a: {mesh: 'builtin:bar', title: 2020-01-01}}")
    config = settings.complete([first, second], {"title": "u", "models": {"a": {"resolution": 9}}})
    assert config["solver"]["modes"] == 30 and config["solver"]["tolerance"] == 1e-5
    assert config["models"]["a"]["title"] == "2020-01-01" and config["title"] == "u"
    assert config["models"]["a"]["resolution"] == 9


@pytest.mark.parametrize(
    ("second", "given", "says"),
    [
        ("title: u", {}, "first.yaml, line 2: models.a.resolution: found 1, expected at least 2"),
        (
            "\nmodels:\n  a:\n    resolution: 0",
            {},
            "second.yaml, line 4: models.a.resolution: found 0, expected",
        ),
        (
            "title: u",
            {"models": {"a": {"resolution": 0}}},
            "--config: models.a.resolution: found 0, expected",
        ),
        (
            "solver:\n  modes: 20\n  mods: 30",
            {},
            "second.yaml, line 3: solver: there is no key 'mods', only .*; did you mean modes",
        ),
    ],
)
def test_a_mistake_is_told_with_the_file_and_line_that_count(
    tmp_path, monkeypatch, second, given, says
):
    monkeypatch.chdir(tmp_path)
    Path("first.yaml").write_text("title: t\nmodels: {a: {mesh: 'builtin:bar', resolution: 1}}\n")
    Path("second.yaml").write_text(second)
    with pytest.raises(UserError, match=says):
        settings.complete(["first.yaml", "second.yaml"], given)


def test_a_configuration_that_snakemake_has_loaded_is_refused_in_a_sentence(dry_run, tmp_path):
    """References in lists are harmless to Snakemake itself, which is before us."""
    (tmp_path / "bomb.yaml").write_text(BOMB)
    done = dry_run(tmp_path, "--cores", 1, "--configfile", "bomb.yaml")
    assert done.returncode != 0
    output = done.stdout + done.stderr
    assert "the reference *a0; write its content out" in output
    assert len(output) < 2000 and "Traceback" not in output


# Jobs of a cluster -------------------------------------------------------------------------------


@pytest.mark.parametrize("path", ["/a/it's", "/a/$(touch x)", "/a/`x`", '/a/"', "/a/\\", "/a\nb"])
def test_jobs_of_a_cluster_are_given_plain_paths(path):
    require_plain(["/a b/Snakefile", Path("/c; d&e")], {"results_dir": "results-2", "poisson": 0.3})
    with pytest.raises(UserError, match="jobs of a cluster"):
        require_plain(["/a/Snakefile", path], {})


@pytest.mark.parametrize("value", ["a b", "$(touch x)", "it's", {"ranks": 2}])
def test_jobs_of_a_cluster_are_given_plain_values(value):
    with pytest.raises(UserError, match="write it into the configuration file"):
        require_plain([], {"title": value})


# Folders of results ------------------------------------------------------------------------------

TABLE = {"name": "t", "caption": "", "columns": [{"key": "a", "label": "A"}], "rows": [{"a": 1}]}
SECONDS = {"key": "a", "label": "A", "kind": "seconds"}


@pytest.mark.parametrize(
    "text",
    [
        *("", "{", "[]", "1", "null", '"a"', "{}", 100_000 * "[", '{"columns": 1}'),
        *(
            json.dumps(TABLE | change)
            for change in (
                {"columns": []},
                {"columns": [1]},
                {"columns": [{"key": "a"}]},
                {"columns": [{"key": "a", "label": "A", "kind": "magic"}]},
                {"columns": [SECONDS], "rows": [{"a": []}]},
                {"columns": [SECONDS], "rows": [{"a": 1e999}]},
                {"rows": 1},
                {"rows": [1]},
                {"keys": ["b"]},
                {"keys": 7},
                {"name": None},
                {"conditions": {"processor": 1}},
                {"conditions": 1},
                {"colour": "red"},
            )
        ),
    ],
)
def test_a_table_that_is_none_is_named(tmp_path, text):
    from studies.comparison.folders import read_folder

    path = tmp_path / "tables" / "t.json"
    path.parent.mkdir()
    path.write_text(json.dumps(TABLE))
    assert list(read_folder(tmp_path).tables) == ["tables/t"]
    path.write_text(text)
    with pytest.raises(UserError, match=r"t\.json: is no table of this version, or damaged"):
        read_folder(tmp_path)
