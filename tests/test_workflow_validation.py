"""`python -m workflow validate`: a mesh and a material of one's own, and what the page says."""

import itertools
import json
import re
import shutil
from dataclasses import asdict
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
import pytest
import trimesh
import yaml
from hypothesis import given
from hypothesis import strategies as st

from carillon.command_line import exit_status
from carillon.errors import UserError
from solver.response.response_file import StrikeOptions, read_response, respond, write_response
from solver.verification.audit import audit_files
from solver.verification.comparison import compare_each
from studies.base.table import read_table
from tests.edited_files import edited
from tests.pages import Page, assert_self_contained
from workflow import snakemake_run
from workflow.__main__ import main
from workflow.validation.criteria import Criterion
from workflow.validation.distance import distance_in_words
from workflow.validation.evidence import COARSENED, Evidence
from workflow.validation.study import VALIDATION
from workflow.variants import SHOWN

SIDES = (80.0, 40.0, 20.0)
RESOLUTION = 8
CELLS = 64
LOOSE = ("frequency_rms=0.5", "frequency_worst=0.9")
"""So coarse a mesh does not come closer after coarsening."""


JUDGED = tuple(variant for variant in SHOWN if variant != COARSENED)
"""Spectra on the page of the block: it is too small to be coarsened, so none is coarse."""


def call(*words: object) -> int:
    return main(["validate", *map(str, words)])


@pytest.fixture(scope="module")
def solid(tmp_path_factory) -> Path:
    """Folder with a box in millimetres and moduli of its voxels."""
    folder = tmp_path_factory.mktemp("solid")
    trimesh.creation.box(SIDES).export(folder / "block.obj")
    young = 1e9 * 10.0 ** np.random.default_rng(5).uniform(-0.5, 0.5, CELLS)
    np.savetxt(folder / "young.txt", young)
    return folder


@pytest.fixture(scope="module")
def run(solid) -> Path:
    """Folder of a finished validation."""
    words = ("--unit", 1e-3, "--density", 2000, "--modes", 24, "--strike", 40, 20, 10)
    out = solid / "out of 'one' $(touch run); a"
    status = call(
        *(solid / "block.obj", "--resolution", RESOLUTION, "--material", solid / "young.txt"),
        *(*words, "--tolerances", *LOOSE, "--out", out),
    )
    log = out / "validate.log"
    assert status == 0, log.read_text()[-6000:] if log.exists() else "nothing ran"
    return out


@pytest.fixture(scope="module")
def page(run) -> Page:
    return Page(run / "validation" / "block.html")


def words_of(page: Page) -> str:
    text = re.sub(r"<(style|svg)\b.*?</\1>|<wbr>", "", page.source, flags=re.DOTALL)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", text))


@pytest.mark.nightly
def test_a_good_spectrum_passes_in_words(run, page):
    text = words_of(page)
    assert "Passed: all 11 criteria are met." in text
    assert "The solid was not coarsened, and the fine one solved in place of a coarse one" in text
    assert "an independent count finds none missing" in text
    rows = read_table(run / "validation" / "tables" / "block-criteria.json").rows
    assert len(rows) == 11 and {row["verdict"] for row in rows} == {"met"}
    shown = [[cell for cell, _ in row] for row in page.tables["criteria"] if row]
    assert [row[1] for row in shown] == [row["shown"] for row in rows]
    for row, (criterion, *_) in zip(rows, shown):
        assert criterion == row["label"] + row["why"] + row["source"]


@pytest.mark.nightly
def test_the_distance_from_the_solid_is_told_and_not_judged(run, page):
    (row,) = read_table(run / "validation" / "tables" / "block-solid.json").rows
    assert 0.0 < row["rms"] < abs(row["worst"]) < 1.0 and row["modes"] == "7–24"
    text = words_of(page)
    assert "How close is the model to the solid?" in text and "told and not judged" in text
    assert row["told"] in text and "--discretisation finite-cell" in text


@pytest.mark.nightly
def test_page_needs_nothing_from_elsewhere_and_can_be_heard(page):
    assert_self_contained(page)
    assert page.source.count("data:audio/wav;base64,") == len(JUDGED)
    assert page.source.count("data:image/png;base64,") >= 4 + len(JUDGED)
    assert len(page.source) < 4e6


@pytest.mark.nightly
def test_no_forest_was_trained_and_the_point_that_was_named_is_struck(run):
    assert not (run / "dataset").exists() and not (run / "forests").exists()
    strike = read_response(run / "models" / "block" / "response.h5").contacts["strike"]
    np.testing.assert_allclose(strike.position, [0.04, 0.02, 0.01], atol=1e-9)
    config = yaml.safe_load((run / "config.yaml").read_text())
    assert config["models"]["block"]["density"] == 2000
    assert config["validation"]["tolerances"]["frequency_rms"] == 0.5


@pytest.mark.nightly
def test_every_number_tells_its_origin(run, page):
    rows = read_table(run / "validation" / "tables" / "block-provenance.json").rows
    files = {row["file"] for row in rows}
    assert {f"models/block/{variant}.h5" for variant in JUDGED} < files
    assert {"models/block/audit.json", "models/block/response.h5"} < files
    for row in rows:
        assert row["command"] and row["commit"] and row["config_hash"] and row["versions"]
    for name in ("block.obj", "young.txt", "truth.h5"):
        assert re.search(rf"\b{name} SHA-256 begins with [0-9a-f]{{16}}\b", words_of(page))


@pytest.mark.nightly
def test_a_mode_that_is_missing_fails_in_words(run, tmp_path):
    """HCMS + EC is robbed of mode 10, and everything after it is done again."""
    shutil.copytree(run, tmp_path / "spoiled", ignore=shutil.ignore_patterns(".snakemake"))
    folder = tmp_path / "spoiled" / "models" / "block"
    with edited(folder / "hcms_ec.h5") as file:
        for name in ("eigenvalues", "frequencies", "residuals"):
            file[name][9:-1] = file[name][10:]
        file["modes"][:, 9:-1] = file["modes"][:, 10:]
    paths = {variant: folder / f"{variant}.h5" for variant in SHOWN}
    compared = compare_each([paths[variant] for variant in SHOWN[1:]], paths["truth"])
    content = {"comparisons": {name: each.as_dict() for name, each in compared.items()}}
    (folder / "comparisons.json").write_text(json.dumps(content | {"provenance": {}}))
    audits = {name: asdict(audit) for name, audit in audit_files(paths.values()).items()}
    (folder / "audit.json").write_text(json.dumps({"spectra": audits, "provenance": {}}))
    candidates = {variant: paths[variant] for variant in SHOWN[1:]}
    write_response(folder / "response.h5", respond(paths["truth"], candidates, StrikeOptions()), {})
    evidence = Evidence(tmp_path / "spoiled", "block")
    evidence.tolerances["solid_rms"] = 1e-9
    tables = VALIDATION.made(evidence)
    (tmp_path / "page.html").write_text(VALIDATION.build(evidence, tables))
    text = words_of(Page(tmp_path / "page.html"))
    missed = {row["key"] for row in tables["criteria"].rows if row["verdict"] == "missed"}
    assert {"eigenvalue_error", "subspace_angle", "response", "counted", "solid_rms"} <= missed
    assert "solid_worst" not in missed and "not close enough" in text
    assert "Failed:" in text and "not the same" in text
    assert "Do not rely on HCMS + EC for this solid and material" in text


def test_what_was_not_found_or_is_no_number_does_not_pass():
    for value in (None, float("nan")):
        assert not Criterion("truth", "key", "label", value, 1.0, "small", "why", "file").passed
    six = Criterion("truth", "rigid", "label", 7, 6, "count", "why", "file", exact=True)
    assert not six.passed and six.row["required"] == "6" and six.row["verdict"] == "missed"


@pytest.mark.parametrize("discretisation", ["voxel", "finite-cell"])
def test_a_distance_that_nobody_could_tell_is_said_to_be_unknown(discretisation):
    settings = {"discretisation": discretisation}
    words = distance_in_words(SimpleNamespace(settings=settings, distance={}))
    assert words["word"] == "not known" and "could not be told" in words["told"]
    assert ("--discretisation" in words["closer"]) == (discretisation == "voxel")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["gone.obj"], "gone.obj: no such file"),
        (["builtin:gong"], "gong"),
        (["builtin:bar", "--material", "cheese"], "material 'cheese' is neither a file nor"),
        (["block.obj", *"--unit 0.01 --material short.txt".split()], "short.txt: 3 values for 64"),
        (["builtin:bar", "--strike", "9", "9", "9"], "strike: the point (9, 9, 9) m is"),
        (["builtin:bar", "--poisson", "-0.3"], "the default forests are for Poisson's ratios 0 to"),
        (["builtin:bar", "--tolerances", "luck=1"], "'luck=1' names no tolerance"),
        (["builtin:bar", "--tolerances", "residual=0"], "found 0.0, expected above 0"),
        (["builtin:bar", "--modes", "6"], "found 6, expected at least 12"),
        (["builtin:bar", "--cores", "1000000000"], "found 1000000000, expected at most"),
        (["builtin:bar", "--seed", str(2**64)], "expected at most 9,223"),
        (["builtin:bar", "--unit", "1e300"], "--unit: found 1e+300, expected at most 1e+12 m"),
        (["builtin:bar", "--density", "1e-300"], "expected at least 0.001 kg/m^3"),
        (["builtin:bar", "--strike", "nan", "0", "0"], "expected a finite number"),
        (["builtin:bar", "--name", "a\nb"], "has a line break"),
        (["a{b}.obj"], "has one of { } < >, which stand for placeholders"),
        (["ü" * 101], "has a name of more than 200 bytes"),
    ],
)
def test_bad_input_is_answered_in_one_sentence(words, says, solid, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(solid)
    (solid / "short.txt").write_text("1e9 1e9 1e9")
    status = call(*words, "--resolution", RESOLUTION, "--out", tmp_path / "out")
    error = capsys.readouterr().err.strip()
    assert status == exit_status.EXIT_BAD_INPUT
    assert says in error and len(error.splitlines()) == 1
    assert not (tmp_path / "out").exists()


@given(done=st.lists(st.integers(1, 6), max_size=6), total=st.integers(1, 40))
def test_steps_are_counted_as_they_are_done(done, total):
    numbers = list(itertools.accumulate(done))
    messages = [{"total": total}, *({"done": number} for number in numbers), {"error": "a fault"}]
    shown: list[int] = []

    def track(steps, *words):
        assert words == ("validation", total, "steps")
        shown.extend(steps)
        return shown

    with patch.object(snakemake_run, "track", track):
        assert snakemake_run.followed(iter(messages), "validation") == "a fault"
    assert shown == list(range(1, sum(done) + 1))


@pytest.mark.parametrize(
    ("rules", "says"),
    [
        (
            "raise WorkflowError('models.c.mesh: names none')",
            "the run failed, Snakemake says: .*models.c.mesh: names none; all that it said is in",
        ),
        (
            "rule validation:\n  shell: 'python -m solver audit none.h5 --out a.json'",
            "the run failed, solver audit: none.h5: ",
        ),
        (
            "rule validation:\n  shell: 'kill -9 $$'",
            "the run failed, rule validation ended without a word, as jobs do that are killed; all",
        ),
        ("rule other:\n  output: 'a'", "the run failed, Snakemake says: .*validation"),
    ],
)
def test_why_a_run_failed_comes_through(rules, says, tmp_path):
    (tmp_path / "Snakefile").write_text(rules)
    (tmp_path / "config.yaml").write_text("{}")
    with pytest.raises(UserError, match=says):
        snakemake_run.run_target(
            "validation",
            tmp_path / "config.yaml",
            cores=1,
            log=tmp_path / "log",
            snakefile=tmp_path / "Snakefile",
        )
