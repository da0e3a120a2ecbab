"""Runs of the crossover: what a launch starts, how rows are judged, and that failures are rows."""

import sys

import pytest
import yaml

from carillon.errors import UserError
from solver.analysis.faster_method import FEWEST_UNKNOWNS
from studies.crossover.cases import cases_of, solid_arguments
from studies.crossover.config import Launch
from studies.crossover.measure import (
    Row,
    Runner,
    _choice,
    _judged,
    _runs_of,
    choice_of_auto,
    launcher_words,
    measure_case,
)
from studies.crossover.methods import METHODS
from tests.workflow_runs import TINY
from workflow import settings
from workflow.configuration.whole import completed

BAR = ["builtin:bar", "--resolution", "10", "--no-estimate"]
PART = {
    "modes": [20],
    "tolerances": [1e-6, 1e-2],
    "methods": ["hcms", "lanczos", "slepc"],
    "runs": 1,
    "most_unknowns": {"slepc": 100},
}


def run(method: str, tolerance: float, *frequencies: float) -> Row:
    about = {"modes": 20, "tolerance": tolerance, "method": method, "unknowns": 1000}
    return {**about, "frequencies": [0.0] * 6 + list(frequencies)}


class Recorder(Runner):
    """Runs nothing: yields prepared rows, and remembers what it was asked for."""

    def __init__(self, *arguments):
        super().__init__(*arguments)
        object.__setattr__(self, "words", [])
        object.__setattr__(self, "rows", [])

    def run(self, words):
        self.words.append(list(words))
        if "slepc" in words:
            return {"problem": "it was ended after 5 s"}
        return self.rows.pop(0) if self.rows else {"seconds": 1.0}


@pytest.fixture
def runner(tmp_path) -> Runner:
    return Runner(Launch(ranks=1), cores=1, seconds=60.0, folder=tmp_path)


def test_ranks_and_threads_never_exceed_the_cores():
    assert Launch(ranks=1).threads_of(4) == 4 and Launch(ranks=3).threads_of(4) == 1
    assert Launch(ranks=5).threads_of(4) == 0 and Launch(ranks=2, threads=3).threads_of(4) == 0
    assert (
        Launch(ranks=6, nodes=3).threads_of(4) == 2
        and Launch(ranks=6, threads=1, nodes=3).threads_of(4) == 1
    )


def test_a_launcher_is_mpiexec_unless_one_is_named():
    assert launcher_words(Launch(ranks=1)) == []
    named = Launch(ranks=3, launcher=f"{sys.executable} -N3 -n3")
    assert launcher_words(named)[1:] == ["-N3", "-n3"]
    with pytest.raises(UserError, match="no gong on PATH"):
        launcher_words(Launch(ranks=2, launcher="gong -n2"))


def test_auto_is_one_of_the_methods():
    for modes, unknowns in ((20, 1000), (256, 1000), (256, 10**6)):
        assert choice_of_auto(modes, 1e-6, unknowns) in METHODS


def test_what_auto_takes_of_a_large_solid_is_what_a_run_takes(tmp_path, monkeypatch):
    runner = Recorder(Launch(ranks=1), 1, 5.0, tmp_path)
    monkeypatch.setattr(Recorder, "run", lambda *_: {"took": "lobpcg"})
    assert _choice(runner, BAR, 64, 1e-2, FEWEST_UNKNOWNS) == "coarse_lobpcg"
    assert _choice(runner, BAR, 64, 1e-2, FEWEST_UNKNOWNS - 1) == "lanczos"
    monkeypatch.setattr(Recorder, "run", lambda *_: {"problem": "it was late"})
    assert _choice(runner, BAR, 64, 1e-2, FEWEST_UNKNOWNS) is None
    assert _choice(runner, BAR, 64, 1e-2, 0) is None


def test_cases_are_all_solids_with_all_launches_each_in_a_file_of_its_own():
    config = settings.complete([TINY])
    launches = [{"ranks": 2}, {"ranks": 2, "nodes": 2, "latency": 2e-6}]
    config["crossover"]["launches"] = launches
    paths = [case.path for case in cases_of(completed(config))]
    assert paths == ["cases/bar/10-2-on-1.json", "cases/bar/10-2-on-2-2e-06s.json"]
    words = solid_arguments(config, cases_of(config)[0])
    assert words[:5] == ["builtin:bar", "--resolution", "10", "--material", "smooth"]


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("launches", [{"ranks": 2}, {"ranks": 2, "threads": 1}], "same ranks, nodes and latency"),
        ("most_unknowns", {"gong": 5}, "'gong' is no method"),
        ("methods", ["auto"], "'auto'"),
    ],
)
def test_a_wrong_configuration_is_told_in_one_sentence(key, value, says):
    config = yaml.safe_load(TINY.read_text())
    config["crossover"][key] = value
    with pytest.raises(UserError, match=says) as caught:
        completed(config)
    assert "\n" not in str(caught.value)


def test_errors_are_against_slepc_or_the_tightest_tolerance():
    rows = [run("hcms", 1e-2, 1.1, 2.0), run("slepc", 1e-2, 1.0, 2.0), run("lanczos", 1e-6, 1, 2.0)]
    hcms, slepc, lanczos = _judged(rows, {1e-6: "lanczos"})
    assert hcms["error"] == pytest.approx(0.21) and not hcms["reached"]
    assert (slepc["error"], slepc["reached"], slepc["reference"]) == (0.0, True, "SLEPc")
    assert lanczos["reached"] and lanczos["auto"] and not hcms["auto"]
    without = _judged([*rows[:1], rows[2], {**rows[1], "method": "lobpcg"}], {})
    assert {row["reference"] for row in without} == {"Block Lanczos"}
    assert "frequencies" not in without[0]


def test_runs_that_are_too_large_or_were_too_slow_before_are_not_run(tmp_path):
    runner = Recorder(Launch(ranks=1), 1, 5.0, tmp_path)
    before = [{"unknowns": 1000}]
    (first, _) = _runs_of(runner, BAR, 20, "slepc", PART, before)
    assert "limit of 100 unknowns" in first["problem"] and runner.words == []
    slow = _runs_of(runner, BAR, 20, "slepc", {**PART, "most_unknowns": {}}, before)
    late = "it was ended after 5 s"
    assert [row["problem"] for row in slow] == [
        late,
        f"it was not run: to a larger tolerance {late}",
    ]
    assert len(runner.words) == 1
    plain = _runs_of(runner, BAR, 20, "hcms", PART, before)
    assert len(runner.words) == 2 and [row["tolerance"] for row in plain] == [1e-2, 1e-6]


def test_a_run_that_fails_or_is_late_says_so(runner):
    (said,) = runner.run(["builtin:gong", *BAR[1:]]).values()
    assert "no such built-in object" in said
    late = Runner(runner.launch, 1, 0.05, runner.folder)
    assert late.run(BAR) == {"problem": "it was ended after 0.05 s"}
    many = Runner(Launch(ranks=2), 1, 60.0, runner.folder)
    assert "too few cores" in many.run(BAR)["problem"]
    strange = Runner(Launch(ranks=2, launcher="gong"), 2, 60.0, runner.folder)
    assert "no gong on PATH" in strange.run(BAR)["problem"]
    assert list(runner.folder.iterdir()) == []


def test_the_fastest_of_several_runs_counts_and_long_ones_run_once(tmp_path):
    runner = Recorder(Launch(ranks=1), 1, 50.0, tmp_path)
    runner.rows.extend({"seconds": s, "whole_seconds": s} for s in (2.0, 1.0, 3.0, 6.0))
    rows = _runs_of(runner, BAR, 20, "lanczos", {**PART, "runs": 3}, [])
    assert [row["seconds"] for row in rows] == [1.0, 6.0] and runner.rows == []


@pytest.mark.mpi
@pytest.mark.nightly
def test_a_case_is_measured_on_two_ranks(tmp_path):
    runner = Runner(Launch(ranks=2), cores=2, seconds=300.0, folder=tmp_path)
    rows = measure_case(runner, BAR, {**PART, "most_unknowns": {}})
    assert len(rows) == 6 and not any("problem" in row for row in rows)
    by = {(row["method"], row["tolerance"]): row for row in rows}
    assert by["lanczos", 1e-6]["error"] <= 1e-6 and by["lanczos", 1e-6]["reached"]
    assert by["hcms", 1e-6]["error"] > 1e-3 and not by["hcms", 1e-6]["reached"]
    for row in rows:
        assert 0.0 < row["seconds"] < row["whole_seconds"] and row["threads"] == 1
        assert row["processor_seconds"] > 0.1
        assert row["peak_memory_bytes"] > 5e7 and row["others"] >= 0.0
