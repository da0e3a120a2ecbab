"""The page of the crossover: from rows to the winners, the sentences, and what the page holds."""

import json

import pytest
import yaml

from studies.base.table import read_table
from studies.crossover.cases import cases_of
from studies.crossover.methods import METHODS
from studies.crossover.results import Crossover, frame_of
from studies.crossover.study import CROSSOVER
from studies.crossover.winners import by_method, fastest, verdict
from tests.pages import assert_holds, finished_page, page_of
from tests.workflow_runs import TINY, finished
from workflow import settings

SECONDS = {"hcms": 0.5, "hcms_ec": 3.0, "lanczos": 2.0, "lobpcg": 9.0, "slepc": 8.0}


def rows(modes: int = 64, tolerance: float = 1e-6, **seconds: float) -> list[dict]:
    """Runs of one cell: HCMS is 5 % off, the others are exact; `auto` is Lanczos."""
    return [
        {
            "modes": modes,
            "tolerance": tolerance,
            "method": method,
            "unknowns": 1000,
            "auto": method == "lanczos",
            "seconds": spent,
            "whole_seconds": spent + 1,
            "processor_seconds": 2 * spent,
            "peak_memory_bytes": 3e8,
            "others": 0.5 if method == "slepc" else 0.0,
            "error": 0.05 if method == "hcms" else 1e-9,
            "reached": method != "hcms" or tolerance > 0.05,
            "reference": "SLEPc",
        }
        for method, spent in {**SECONDS, **seconds}.items()
    ]


def study_of(folder, first: list[dict], second: list[dict], **part) -> Crossover:
    """The folder of a study whose two cases, on one and on two ranks, have found these runs."""
    given = yaml.safe_load(TINY.read_text())
    given["crossover"] = {"models": {"bar": {"mesh": "builtin:bar", "resolutions": [10]}}, **part}
    (folder / "given.yaml").write_text(yaml.safe_dump(given))
    config = settings.complete([folder / "given.yaml"])
    (folder / "config.yaml").write_text(yaml.safe_dump(config))
    study = Crossover(folder / "crossover")
    for case, found in zip(cases_of(config), (first, second), strict=True):
        path = study.folder / case.path
        path.parent.mkdir(parents=True, exist_ok=True)
        origin = {"processor": "A processor", "date": "2026-01-01", "commit": "none"}
        path.write_text(json.dumps({"runs": found, "provenance": origin}))
    return study


@pytest.fixture
def study(tmp_path) -> Crossover:
    failed = {"method": "arpack", "modes": 64, "tolerance": 1e-6, "unknowns": 1000, "auto": False}
    first = [*rows(), {**failed, "problem": "it was ended after 5 s"}, *rows(tolerance=0.1)]
    return study_of(tmp_path, first, [*rows(256, hcms_ec=1.0), *rows(256, 0.1, hcms=4.0)])


def test_the_fastest_is_within_the_tolerance(study):
    tight, loose, several, other = fastest(study.runs).to_dict("records")
    assert (tight["method"], tight["second"], loose["method"]) == ("lanczos", "HCMS + EC", "hcms")
    assert tight["times_second"] == 1.5 and tight["times_slepc"] == 4.0
    assert (tight["times_hcms"], tight["error"], tight["times_auto"]) == (0.25, 0.05, 1.0)
    assert (loose["times_hcms"], loose["times_hcms_ec"], loose["times_auto"]) == (1.0, 6.0, 4.0)
    assert (several["method"], several["times_auto"]) == ("hcms_ec", 2.0)
    assert other["method"] == "lanczos" and other["times_hcms"] == 2.0


def test_methods_are_rated_over_all_cells(study):
    by = {row["method"]: row for row in by_method(study.runs)}
    assert list(by) == [name for name in METHODS if name not in ("hcms_lobpcg", "coarse_lobpcg")]
    assert [by[name]["wins"] for name in ("hcms", "hcms_ec", "lanczos")] == [1, 1, 2]
    assert (by["hcms"]["runs"], by["hcms"]["reached"]) == (4, 2)
    assert (by["arpack"]["runs"], by["arpack"]["ended"]) == (1, 0)
    assert by["arpack"]["times_worst"] is None and by["hcms_ec"]["times_worst"] == 6.0


def test_sentences_tell_where_the_papers_method_wins_and_where_not(study):
    first, plain, corrected, auto = verdict(study.runs)
    assert first == (
        "Of 4 cases, the fastest method is Block Lanczos in 2, HCMS in 1, HCMS + EC in 1."
    )
    assert "errors of 0.050 at" in plain and "within the tolerance in 2 of 4 cases" in plain
    assert "wins 1 of these: 1,000 unknowns, 64 modes, 1 rank, tolerance 0.1" in plain
    assert corrected.startswith("HCMS + EC wins 1 of 4 cases: 1,000 unknowns, 256 modes, 2 ranks")
    assert "1.5× to 6.0× the time of the fastest, the most at 1,000 unknowns, 64" in corrected
    assert "in 2 of 4 cases; its worst choice is Block Lanczos instead of HCMS, 4.0×" in auto


def test_sentences_say_what_was_not_run_and_where_nothing_wins():
    assert verdict(frame_of([])) == ["No method has reached its tolerance anywhere."]


def test_without_a_tolerance_that_it_reaches_plain_hcms_cannot_win(tmp_path):
    study = study_of(tmp_path, rows(), rows())
    _, plain, corrected, auto = verdict(study.runs)
    assert "misses every tolerance. It takes less time" in plain and "in 2 of 2 cases" in plain
    assert corrected.startswith("HCMS + EC wins none of 2 cases; it takes 1.5× the time")
    assert auto.endswith("in 2 of 2 cases.")


def test_the_page_holds_tables_and_figures(study):
    page = page_of(CROSSOVER, study, study.folder / "report.html")
    assert_holds(page, CROSSOVER, study.folder)
    assert "64 modes, to 10⁻⁶, 1 rank, ARPACK: it was ended after 5 s" in page.source
    assert "Beside 4 of 20 runs other programs had more than 0.2 cores, up to 0.5" in page.source
    assert 'class="met">Block Lanczos</td>' in page.source
    assert 'class="missed">Block Lanczos 4.0×</td>' in page.source


def test_a_page_is_made_when_every_run_failed(tmp_path):
    about = {"method": "slepc", "modes": 64, "tolerance": 1e-6}
    failed = [{**about, "problem": "it was not run: too few cores"}]
    study = study_of(tmp_path, failed, failed)
    page = page_of(CROSSOVER, study, study.folder / "report.html")
    assert "No method has reached its tolerance anywhere." in page.source
    assert page.source.count("<li>Bar, 64 modes, to 10⁻⁶") == 2


def test_runs_of_another_machine_are_joined_and_compete_among_themselves(study, tmp_path):
    page_of(CROSSOVER, study, study.folder / "report.html")
    runs = (study.folder / "tables" / "runs.csv").read_text().replace("A processor", "Far away")
    (tmp_path / "far.csv").write_text(runs)
    both = tmp_path / "both"
    both.mkdir()
    joined = study_of(both, rows(), rows(), joined=[str(tmp_path / "far.csv")])
    cells = fastest(joined.runs)
    assert cells["machine"].value_counts().to_dict() == {"Far away": 4, "A processor": 2}
    far = cells[cells["machine"] == "Far away"].drop(columns="machine")
    own = fastest(study.runs).drop(columns="machine")
    assert far.reset_index(drop=True).equals(own.reset_index(drop=True))
    page = page_of(CROSSOVER, joined, joined.folder / "report.html")
    assert_holds(page, CROSSOVER, joined.folder)
    assert "2 ranks, Far away" in page.source


def test_the_study_is_no_part_of_the_default_run(plan):
    assert "measure_crossover" not in plan()
    assert plan("crossover")["measure_crossover"] == 3 * 2


@pytest.mark.mpi
@pytest.mark.nightly
def test_a_miniature_study_ends_with_a_page(tmp_path):
    finished(tmp_path, "crossover")
    folder = tmp_path / "results-tiny" / "crossover"
    finished_page(CROSSOVER, folder)
    found = read_table(folder / "tables/runs.json").rows
    assert len(found) == 2 * 4 * 2 and not any(row.get("problem") for row in found)
    errors = {row["method"]: row["error"] for row in found if row["tolerance"] == 1e-6}
    assert errors["lanczos"] <= 1e-6 < errors["hcms"]
