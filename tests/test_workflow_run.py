"""The smallest run from end to end: it finishes, is not repeated, and its page is what it says."""

import subprocess
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest
import yaml
from markupsafe import escape

from solver.files.modes_file import FINE_TAKEN, read_modes
from studies.base.conditions import LABELS
from studies.base.numbers import MISSING
from studies.base.table import read_table
from tests.pages import Page, assert_same_numbers, assert_self_contained
from tests.workflow_runs import PROFILE, TINY, planned, snakemake
from workflow.report.study import REPORT
from workflow.settings import config_hash
from workflow.variants import candidates_of, shown_of, variants_of

pytestmark = pytest.mark.slow

MODELS = list(yaml.safe_load(TINY.read_text())["models"])
DISCRETISED = {MODELS[0]: "voxel", MODELS[1]: "finite-cell"}
"""How the models are divided in this run."""
NOT_SHOWN = ("phases", "frequencies", "scaling")
"""Tables that are not on the page, or not all of them; the smallest run measures no scaling."""
APART = ("provenance", "training", "scaling")
"""Tables without conditions: of many results with their own origins, or of none."""


NAME = "results of 'one' $(touch run); touch run"
"""Of the folder of the results, as hostile as a name may be."""
TITLE = "<script>alert(1)</script> $\\frac$ & |"
"""Of a model and of the report."""


def of_model(names: Callable[[Any], Iterable[str]], model: str) -> list[str]:
    """Variants of a model that `names` tells."""
    return list(names({"discretisation": DISCRETISED[model]}))


def run_tiny(folder: Path, *more: str) -> subprocess.CompletedProcess[str]:
    options = ["--profile", PROFILE, "--configfile", TINY, "names.yaml"]
    return snakemake(folder, *options, *more)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Folder in which the tiny run has finished."""
    folder = tmp_path_factory.mktemp("tiny")
    models = {name: {"discretisation": kind} for name, kind in DISCRETISED.items()}
    models[MODELS[0]]["title"] = TITLE
    names = {"results_dir": NAME, "title": TITLE, "models": models, "times": {"models": MODELS}}
    (folder / "names.yaml").write_text(yaml.safe_dump(names))
    done = run_tiny(folder)
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-6000:]
    return folder


@pytest.fixture(scope="module")
def results(finished):
    return finished / NAME


@pytest.fixture(scope="module")
def page(results):
    return Page(results / "report.html")


def test_a_second_run_does_nothing_but_compare_with_the_baseline(finished):
    done = run_tiny(finished, "--config", f"baseline={NAME}", "--", "all", "compare")
    assert planned(done) == {"compare": 1, "total": 1}
    assert "none moved beyond noise" in done.stdout + done.stderr
    assert (finished / NAME / "comparison" / "comparison.html").is_file()


def test_resolved_configuration_lies_beside_the_results(results):
    config = yaml.safe_load((results / "config.yaml").read_text())
    assert list(config["models"]) == MODELS
    assert "baseline" not in config
    # A value that the file leaves to the schema.
    assert config["solver"]["tolerance"] == 1e-7


def test_nothing_unfinished_is_left(results):
    assert [path for path in results.rglob("*") if "partial" in path.name] == []


def test_names_are_neither_run_nor_taken_for_markup(finished, results):
    assert {path.name for path in finished.iterdir()} == {".snakemake", "names.yaml", NAME}
    pages = list(results.rglob("*.html"))
    assert len(pages) >= 1 + len(MODELS)
    for path in pages:
        source = path.read_text(encoding="utf-8")
        assert "<script>alert" not in source
        assert escape(TITLE) in source or path.stem not in ("report", MODELS[0])


def test_page_needs_nothing_from_elsewhere(page):
    assert_self_contained(page)


def test_page_shows_every_model_with_its_pictures(page, results):
    for model in MODELS:
        assert f"model-{model}" in page.ids
        for variant in of_model(shown_of, model):
            assert (results / "figures" / f"{model}-mode-{variant}.png").stat().st_size > 1000
        assert (results / "figures" / f"{model}-overview.png").is_file()
    coarse = [results / "models" / model / "ddfem_hcms_ec.h5" for model in MODELS]
    taken = [path for path in coarse if path.exists() and FINE_TAKEN in read_modes(path).attributes]
    # What a solid was not coarsened to is drawn for nobody.
    drawn = sum(len(of_model(shown_of, model)) for model in MODELS) - len(taken)
    assert page.source.count("data:image/png;base64,") == drawn


@pytest.mark.parametrize("name", [name for name in REPORT.tables if name not in NOT_SHOWN])
def test_page_and_files_hold_the_same_numbers(page, results, name):
    assert_same_numbers(page, results / "tables", name)


def test_frequencies_on_the_page_are_those_of_the_table(page, results):
    table = read_table(results / "tables" / "frequencies.json")
    known = {row["truth"]: row for row in table.rows}
    keys = [column.key for column in table.shown if column.key != "model"]
    shown = [row for row in page.tables["frequencies"] if row]
    assert len(shown) >= 12 * len(MODELS)
    for cells in shown:
        values = [float(value) for _, value in cells]
        row = known[values[1]]
        assert values == [row[key] for key in keys if key in row]


def test_spectra_satisfy_what_the_page_claims(results):
    summary = read_table(results / "tables" / "summary.json").rows
    assert [row["model"] for row in summary] == MODELS
    for row in summary:
        # The tolerance of 1e-7 is on the solver's own estimate of the error.
        assert row["hcms_ec_error"] < 1e-6 < row["hcms_error"]
        told = results / "validation" / "tables" / f"{row['model']}-solid.json"
        assert read_table(told).rows[0]["rms"] == row["solid_error"] > 0.0
        if DISCRETISED[row["model"]] == "voxel":
            coarse = read_modes(results / "models" / row["model"] / "ddfem_hcms_ec.h5")
            fewer = row["coarse_unknowns"] < row["unknowns"]
            assert fewer != (FINE_TAKEN in coarse.attributes)
        else:
            assert "coarse_unknowns" not in row and "ddfem_error" not in row
    for row in read_table(results / "tables" / "evidence.json").rows:
        assert row["rigid_modes"] == 6
        assert row["orthogonality"] < 1e-8
        if row["inertia"] is not None:
            expected, counted = row["inertia"].split(" / ")
            assert expected == counted


def test_every_result_tells_its_origin(results):
    rows = read_table(results / "tables" / "provenance.json").rows
    files = {row["file"] for row in rows}
    for model in MODELS:
        assert {f"models/{model}/{name}.h5" for name in of_model(variants_of, model)} <= files
    assert "forests/forests.h5" in files
    for row in rows:
        assert row["command"] and row["commit"] and row["config_hash"] and row["versions"]


@pytest.mark.parametrize("name", [name for name in REPORT.tables if name not in APART])
def test_every_benchmark_table_tells_its_conditions(page, results, name):
    table = read_table(results / "tables" / f"{name}.json")
    texts = table.conditions.texts
    # The checkout may be committed to while the run is under way.
    assert texts.pop("differing", "commit") == "commit"
    assert set(texts) == set(LABELS) - {"differing"}
    assert MISSING not in texts.values()
    assert texts["configuration"] == config_hash(
        yaml.safe_load((results / "config.yaml").read_text())
    )
    if name not in NOT_SHOWN:
        assert escape(table.conditions.headline) in page.source
    timed = [column.key for column in table.columns if column.kind == "seconds"]
    if name in ("spreads", "blocks"):
        assert any(f"{key}_min" in timed and f"{key}_max" in timed for key in timed)


def test_timed_rules_leave_benchmarks(results):
    for model in MODELS:
        for variant in of_model(candidates_of, model):
            assert (results / "benchmarks" / "models" / model / f"{variant}.tsv").is_file()


def test_finite_cells_are_validated_and_timed_without_coarse_models(results):
    cells = MODELS[1]
    rows = read_table(results / "validation" / "tables" / f"{cells}-criteria.json").rows
    assert {row["group"] for row in rows} == {"truth", "hcms_ec"}
    assert {row["verdict"] for row in rows} == {"met"}
    methods = {row["model"]: row for row in read_table(results / "tables" / "methods.json").rows}
    assert methods[cells]["hcms_ec"] > 0.0 and methods[cells].get("dof_coarse") is None
    assert methods[cells].get("ddfem") is None and methods[MODELS[0]]["ddfem"] > 0.0
