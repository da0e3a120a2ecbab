"""Validators of others accept crates and the citation file (requirements-archive.txt)."""

import json
import shutil
from pathlib import Path

import pytest

from tests.programs import CHECKOUT, run
from tests.workflow_runs import PROFILE, TINY, snakemake
from workflow.__main__ import main
from workflow.crate.graph import TERMS

pytestmark = pytest.mark.nightly

VENV = CHECKOUT / "build" / "archive-venv" / "bin"
PROFILES = (
    "ro-crate-1.1",
    "workflow-ro-crate-1.0",
    "process-run-crate-0.5",
    "workflow-run-crate-0.5",
)
OLDER = {
    "ComputationalWorkflow": "https://bioschemas.org/ComputationalWorkflow",
    "FormalParameter": "https://bioschemas.org/FormalParameter",
    "input": "https://bioschemas.org/ComputationalWorkflow#input",
    "output": "https://bioschemas.org/ComputationalWorkflow#output",
}
"""Terms that RO-Crate 1.1 has elsewhere than 1.3, whose context comes with rocrate."""


def program(name: str) -> Path:
    """A program of the validators' environment, or skip the test."""
    if not (VENV / name).exists():
        pytest.skip(f"{name} is not in build/archive-venv (requirements-archive.txt)")
    return VENV / name


@pytest.fixture(scope="module")
def archive(tmp_path_factory) -> Path:
    """Crate of a run, of which one model's truth is made."""
    folder = tmp_path_factory.mktemp("run")
    targets = ("results-tiny/models/bar/truth.h5", "results-tiny/config.yaml")
    done = snakemake(folder, *targets, "--profile", PROFILE, "--configfile", TINY)
    assert done.returncode == 0, done.stdout + done.stderr
    out = folder / "run.zip"
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["crate", "results-tiny", "--out", str(out)]) == 0
    return out


@pytest.fixture(scope="module")
def contexts(tmp_path_factory) -> Path:
    """Contexts that the metadata of crates name, by their addresses."""
    from rocrate import vocabs

    terms = {**vocabs.RO_CRATE["@context"], **OLDER}
    checksum = {"sha256": "https://w3id.org/ro/terms/workflow-run#sha256"}
    path = tmp_path_factory.mktemp("contexts") / "contexts.json"
    by_address = {"https://w3id.org/ro/crate/1.1/context": terms, TERMS: checksum}
    path.write_text(json.dumps({name: {"@context": each} for name, each in by_address.items()}))
    return path


@pytest.mark.parametrize("profile", PROFILES)
def test_crates_have_all_that_a_profile_requires(profile, archive, contexts):
    python = program("rocrate-validator").with_name("python")
    words = ["-y", "--disable-color", "validate", archive, "-p", profile, "--no-cache", "-v"]
    script = CHECKOUT / "tests" / "offline_validator.py"
    done = run(python, script, contexts, *words, "--no-paging", cwd=archive.parent)
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"RO-Crate is a valid {profile}" in done.stdout


def test_a_crate_without_its_workflow_is_refused(archive, contexts, tmp_path):
    python = program("rocrate-validator").with_name("python")
    broken = tmp_path / "broken"
    shutil.unpack_archive(archive, broken)
    (broken / "workflow" / "Snakefile").unlink()
    words = ["-y", "validate", broken, "-p", PROFILES[-1], "--no-cache", "-v", "--no-paging"]
    script = CHECKOUT / "tests" / "offline_validator.py"
    assert run(python, script, contexts, *words, cwd=tmp_path).returncode != 0


def test_the_citation_file_is_valid():
    done = run(program("cffconvert"), "--validate", cwd=CHECKOUT)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "valid according to schema version 1.2.0" in done.stdout


def test_zenodo_reads_of_the_citation_what_the_own_file_says():
    done = run(program("cffconvert"), "-f", "zenodo", cwd=CHECKOUT, check=True)
    own = json.loads((CHECKOUT / ".zenodo.json").read_text())
    made = json.loads(done.stdout)
    for key in ("title", "description", "creators", "keywords"):
        assert own[key] == made[key]
    assert own["license"] == made["license"]["id"]
