"""What is made anew after a change: what depends on it, and nothing else."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.patience import HANG_SECONDS
from tests.workflow_runs import CHECKOUT, planned
from workflow import source_files, sources

PACKAGES = "carillon dataset_gen forests solver sound studio workflow studies".split()
CONFIG = """\
results_dir: results
models: {{bar: {{mesh: 'builtin:bar', resolution: 8}}}}
dataset: {{samples: 200, distributions: [uniform], shards: 1, seed: {seed}}}
forests: {{trees: 1, structure_rows: 800, blocks: {blocks}}}
"""
TARGETS = ("results/dataset/uniform-0.json", "results/forests/forests.json")


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A project of three modules, whose fingerprints are asked for."""
    folder = tmp_path / "project"
    (folder / "room").mkdir(parents=True)
    (folder / "room" / "__init__.py").write_text("")
    (folder / "room" / "first.py").write_text("from room.second import VALUE\n")
    (folder / "room" / "second.py").write_text("VALUE = open('data.json')\n")
    (folder / "room" / "data.json").write_text("1")
    (folder / "room" / "third.py").write_text("import room.first\n")
    monkeypatch.setattr(sources, "ROOT", folder)
    monkeypatch.setattr(sources, "ROOMS", ("room",))
    monkeypatch.setattr(source_files, "KEPT", folder / "kept.json")
    return folder / "room"


def fingerprint(*modules):
    for cached in (sources._file_of, sources._named_in, sources._content):
        cached.cache_clear()
    return sources.fingerprint(*modules)


@pytest.mark.parametrize(
    ("file", "text", "counts"),
    [
        pytest.param("second.py", "VALUE = open('data.json', 'rb')\n", True, id="imported"),
        pytest.param("third.py", "import room.second\n", False, id="not imported"),
        pytest.param("data.json", "2", True, id="data that is named"),
        pytest.param(
            "first.py",
            '"""Text."""\n# Text.\nfrom room.second import VALUE  # text\n',
            False,
            id="comments and docstrings",
        ),
    ],
)
def test_a_module_counts_with_all_that_it_imports_and_names(project, file, text, counts):
    before = fingerprint("room.first")
    (project / file).write_text(text)
    assert (fingerprint("room.first") != before) == counts


def again(project):
    """Keep what was read and forget it, as between two runs."""
    source_files._keep()
    source_files._known.cache_clear()
    return project.parent / "kept.json"


@pytest.fixture
def parsed(project, monkeypatch):
    """How often a file was parsed, after a first run."""
    source_files._known.cache_clear()
    fingerprint("room.first")
    again(project)
    calls = []
    parse = source_files._parsed
    monkeypatch.setattr(source_files, "_parsed", lambda text: calls.append(text) or parse(text))
    yield calls
    source_files._known.cache_clear()


def test_files_are_parsed_once_for_all_runs(project, parsed):
    before = fingerprint("room.first")
    again(project)
    assert fingerprint("room.first") == before
    assert not parsed


def test_a_changed_file_is_parsed_again(project, parsed):
    before = fingerprint("room.first")
    (project / "second.py").write_text("VALUE = open('data.json', 'rb')\n")
    assert fingerprint("room.first") != before
    assert len(parsed) == 1


@pytest.mark.parametrize("damage", ["", "{", "[]", '{"a": 1}', '{"a": ["b", ["c"]]}'])
def test_what_was_kept_may_be_damaged(project, parsed, damage):
    before = fingerprint("room.first")
    again(project).write_text(damage)
    assert fingerprint("room.first") == before
    assert len(parsed) == 3


def test_a_module_that_does_not_exist_is_an_error(project):
    with pytest.raises(ValueError, match="no module room.fourth"):
        fingerprint("room.fourth")


def test_every_rule_that_runs_a_package_says_which_modules():
    for path in (CHECKOUT / "workflow" / "rules").glob("*.smk"):
        for rule in re.split(r"(?m)^ *(?=(?:use )?rule\b.*:$)", path.read_text())[1:]:
            runs = "    shell:" in rule or "    script:" in rule
            changed = rule.startswith("use") and "    params:" in rule
            if runs or changed:
                assert re.search(r"source=source\(|\*\*(made_by|made_with_tables)\(", rule), rule


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A copy of the project beside a finished run of some of its rules."""
    copy = tmp_path_factory.mktemp("copy")
    for package in PACKAGES:
        # With its compiled kernels, but for what others are writing.
        others = shutil.ignore_patterns("*.pyc*", "*.tmp.*", ".*")
        shutil.copytree(CHECKOUT / package, copy / package, ignore=others)
    shutil.copy(CHECKOUT / "Snakefile", copy)
    write_config(copy)
    done = snakemake(copy)
    assert done.returncode == 0, done.stdout + done.stderr
    return copy


def write_config(copy: Path, seed: int = 0, blocks: int = 10) -> None:
    (copy / "config.yaml").write_text(CONFIG.format(seed=seed, blocks=blocks))


def snakemake(copy: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """Snakemake on the copy."""
    command = [sys.executable, "-m", "snakemake", *TARGETS, "--cores", "2"]
    return subprocess.run(
        [*command, "--configfile", "config.yaml", *options],
        cwd=copy,
        env={**os.environ, "PYTHONPATH": str(copy)},
        capture_output=True,
        text=True,
        timeout=HANG_SECONDS,
    )


def repeated(copy: Path) -> set[str]:
    """Rules that would run again."""
    done = snakemake(copy, "--dry-run")
    if "Nothing to be done" in done.stdout + done.stderr:
        return set()
    return set(planned(done)) - {"total"}


def change(path: Path, addition: str) -> None:
    """Put lines in front of the first plain import of a module."""
    text = path.read_text()
    place = text.index("\nimport ") + 1
    path.write_text(text[:place] + addition + text[place:])


@pytest.mark.nightly
def test_what_did_not_change_is_not_repeated(run):
    change(run / "dataset_gen" / "generate.py", "# A remark.\n")
    change(run / "solver" / "correction" / "lanczos.py", "CHANGED = True\n")
    write_config(run, blocks=20)
    assert repeated(run) == set()


@pytest.mark.nightly
def test_a_changed_source_repeats_what_depends_on_it(run):
    change(run / "forests" / "training" / "leaf_fit.py", "CHANGED = True\n")
    # Trees stay as they are; the forests' description is made anew because they are.
    assert repeated(run) == {"train_forests", "describe_forests"}


@pytest.mark.nightly
def test_a_changed_parameter_repeats_what_depends_on_it(run):
    write_config(run, seed=1)
    data, forests = {"generate_shard", "describe_shard"}, {"train_forests", "describe_forests"}
    assert repeated(run) == data | {"grow_tree"} | forests
