"""The smallest run from end to end: it finishes, is not repeated, and its page is what it says."""

from __future__ import annotations

import csv
import os
import re
import subprocess
import sys
import time
from html.parser import HTMLParser
from pathlib import Path

import pytest
import yaml

from workflow.report.numbers import show
from workflow.report.page import unbroken
from workflow.report.table import read_table
from workflow.report.tables import BUILDERS
from workflow.variants import CANDIDATES, SHOWN, VARIANTS

pytestmark = pytest.mark.slow

CHECKOUT = Path(__file__).resolve().parent.parent
CONFIG = CHECKOUT / "workflow" / "config" / "tiny.yaml"
PROFILE = CHECKOUT / "workflow" / "profiles" / "default"
MODELS = list(yaml.safe_load(CONFIG.read_text())["models"])
SECOND_RUN_SECONDS = 30
"""A run with nothing to do is planned within seconds; the rest is for a busy machine."""


def run_tiny(folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "snakemake", "-s", CHECKOUT / "Snakefile"]
    command += ["--profile", PROFILE, "--configfile", CONFIG, "--config", "results_dir=results"]
    return subprocess.run(
        [str(part) for part in command],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
        capture_output=True,
        text=True,
        timeout=900,
    )


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Folder in which the tiny run has finished."""
    folder = tmp_path_factory.mktemp("tiny")
    done = run_tiny(folder)
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-6000:]
    return folder


@pytest.fixture(scope="module")
def results(finished):
    return finished / "results"


@pytest.fixture(scope="module")
def page(results):
    return Page(results / "report.html")


class Page(HTMLParser):
    """What a browser would load and show."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.source = path.read_text(encoding="utf-8")
        self.links: list[str] = []
        self.ids: list[str] = []
        self.tables: dict[str, list[list[tuple[str, str | None]]]] = {}
        self._table: str | None = None
        self._in_cell = False
        self.feed(self.source)

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        for key in ("src", "href", "xlink:href", "srcset", "data", "action", "poster"):
            if found.get(key):
                self.links.append(found[key])
        if found.get("id"):
            self.ids.append(found["id"])
        if tag == "table":
            self._table = found["data-table"]
            self.tables.setdefault(self._table, [])
        elif tag == "tr" and self._table:
            self.tables[self._table].append([])
        elif tag == "td":
            self.tables[self._table][-1].append(("", found.get("data-value")))
            self._in_cell = True

    def handle_endtag(self, tag):
        if tag == "td":
            self._in_cell = False
        elif tag == "table":
            self._table = None

    def handle_data(self, data):
        if self._in_cell:
            text, value = self.tables[self._table][-1][-1]
            self.tables[self._table][-1][-1] = (text + data, value)


def test_a_second_run_does_nothing(finished):
    begin = time.monotonic()
    done = run_tiny(finished)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Nothing to be done" in done.stdout + done.stderr
    assert time.monotonic() - begin < SECOND_RUN_SECONDS


def test_resolved_configuration_lies_beside_the_results(results):
    config = yaml.safe_load((results / "config.yaml").read_text())
    assert list(config["models"]) == MODELS
    # A value that the file leaves to the schema.
    assert config["solver"]["tolerance"] == 1e-7


def test_nothing_unfinished_is_left(finished):
    left = [path for path in (finished / "results").rglob("*") if "partial" in path.name]
    assert left == []


def test_page_needs_nothing_from_elsewhere(page):
    assert page.links
    assert all(link.startswith(("data:", "#")) for link in page.links)
    assert not re.search(r"@import|url\((?!#)", page.source)
    assert "<script" not in page.source
    assert len(page.ids) == len(set(page.ids))


def test_page_shows_every_model_with_its_pictures(page, results):
    for model in MODELS:
        assert f"model-{model}" in page.ids
        for variant in SHOWN:
            assert (results / "figures" / f"{model}-mode-{variant}.png").stat().st_size > 1000
        assert (results / "figures" / f"{model}-overview.png").is_file()
    assert page.source.count("data:image/png;base64,") == len(MODELS) * len(SHOWN)


@pytest.mark.parametrize(
    "name", [name for name in BUILDERS if name not in ("phases", "frequencies")]
)
def test_page_and_files_hold_the_same_numbers(page, results, name):
    table = read_table(results / "tables" / f"{name}.json")
    rows = list(csv.reader((results / "tables" / f"{name}.csv").open()))[1:]
    shown = [row for row in page.tables[name] if row]
    assert len(shown) == len(rows) == len(table.rows) > 0
    markdown = (results / "tables" / f"{name}.md").read_text()
    on_page = {"processor", "cores", "versions", "blas"} if name == "provenance" else set()
    columns = [column for column in table.shown if column.key not in on_page]
    for row, cells, line in zip(table.rows, shown, rows):
        raw = dict(zip([column.key for column in table.columns], line))
        for column, (text, value) in zip(columns, cells, strict=True):
            assert text == unbroken(row.get(column.key), column.kind)
            assert show(row.get(column.key), column.kind).replace("|", "/") in markdown
            if column.kind not in ("text", "range"):
                assert raw[column.key] == ("" if value == "None" else value)


def test_frequencies_on_the_page_are_those_of_the_table(page, results):
    table = read_table(results / "tables" / "frequencies.json")
    known = {(row["truth"], row["ddfem_hcms_ec"]): row for row in table.rows}
    shown = [row for row in page.tables["frequencies"] if row]
    assert len(shown) >= 12 * len(MODELS)
    for cells in shown:
        values = [float(value) for _, value in cells]
        row = known[values[1], values[6]]
        assert values[0] == row["mode"]
        assert values[7] == row["ddfem_hcms_ec_error"]


def test_spectra_satisfy_what_the_page_claims(results):
    summary = read_table(results / "tables" / "summary.json").rows
    assert [row["model"] for row in summary] == MODELS
    for row in summary:
        # The tolerance of 1e-7 is on the solver's own estimate of the error.
        assert row["hcms_ec_error"] < 1e-6 < row["hcms_error"]
        assert row["coarse_unknowns"] < row["unknowns"]
    for row in read_table(results / "tables" / "evidence.json").rows:
        assert row["rigid_modes"] == 6
        assert row["orthogonality"] < 1e-8
        if row["inertia"] is not None:
            found, counted = row["inertia"].split(" / ")
            assert found == counted


def test_every_result_tells_its_origin(results):
    rows = read_table(results / "tables" / "provenance.json").rows
    files = {row["file"] for row in rows}
    assert {f"models/{model}/{name}.h5" for model in MODELS for name in VARIANTS} <= files
    assert "forests/forests.h5" in files
    for row in rows:
        assert row["command"] and row["commit"] and row["config_hash"] and row["versions"]


def test_timed_rules_leave_benchmarks(results):
    for model in MODELS:
        for variant in CANDIDATES:
            assert (results / "benchmarks" / "models" / model / f"{variant}.tsv").is_file()
