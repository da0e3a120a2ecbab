"""The study of the objectives: pooling, goals, what is left out, and a miniature end to end."""

import json

import pytest
import yaml

from carillon.errors import UserError
from dataset_gen.objectives import OBJECTIVES
from studies.base.cases import cases_of
from studies.base.table import read_table
from studies.objectives.goals import goals_of, judge
from studies.objectives.page import shortened
from studies.objectives.results import Objectives
from studies.objectives.study import OBJECTIVES as DESCRIBED
from studies.objectives.study import arguments
from studies.objectives.tables import description
from tests.pages import finished_page
from tests.small_forests import train_small_forests
from tests.workflow_runs import LAPTOP, TINY, finished
from workflow import settings, solids
from workflow.configuration.whole import completed

summary, errors, forest, goals, goal_cases = (
    DESCRIBED.entries[name] for name in ("summary", "errors", "forest", "goals", "goal-cases")
)
STUDY = {
    "models": {
        "box": {"title": "", "mesh": "builtin:box", "resolutions": [8, 16], "components": "error"},
        "bust": {"title": "", "mesh": "bust.obj", "resolutions": [24], "components": "error"},
    },
    "materials": ["uniform", "noise"],
    "modes": 70,
    "objectives": ["good"],
    "goals": [
        {"model": "box", "quantity": "rms", "limit": 0.03},
        {"model": "box", "quantity": "rms_of_galerkin", "limit": 0.5, "resolutions": [16]},
        {"model": "box", "quantity": "worst", "limit": 0.04, "materials": ["noise"]},
        {"model": "bust", "quantity": "rms", "limit": 0.05},
        {"quantity": "rms_of_fit", "limit": 1.1},
    ],
}
RMS = {
    "good": {"uniform": 0.03, "noise": 0.04},
    "ddfem": {"uniform": 0.03, "noise": 0.048},
    "galerkin": {"uniform": 0.06, "noise": 0.1},
}
FOREST = {"forest": "default", "forest_objective": "good", "forest_sha256": "0123456789abcdef"}


def rated(material: str, resolution: int) -> dict:
    """What `solver objectives` would write: half the error at twice the resolution."""

    def part(rms: float, last: int) -> dict:
        errors = {"first": 7, "last": last, "rms": rms, "mean": rms / 2}
        return {**errors, "worst": -1.5 * rms, "worst_mode": 9}

    rows = []
    for name, by_material in RMS.items():
        rms = by_material[material] * 8 / resolution
        times = {"fit_seconds": 0.1, "solve_seconds": 0.2}
        last = 66 if resolution == 8 else 70
        rows.append(
            {
                "coarsening": name,
                "audible": part(rms, 60),
                "all": part(2 * rms, last),
                "converged": 1.0 if name == "good" else None,
                **times,
            }
        )
    return {"n_dofs": 300, "coarse_n_dofs": 66, "modes": 70, "rows": rows, "forest": FOREST}


@pytest.fixture
def study(tmp_path) -> Objectives:
    """A study of a box, whose other solid has no mesh."""
    any_case = {"model": None, "resolutions": None, "materials": None}
    goals = [{**any_case, **goal} for goal in STUDY["goals"]]
    config = {"mesh_folder": str(tmp_path), "objectives": {**STUDY, "goals": goals}}
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(config))
    study = Objectives(tmp_path / "objectives")
    for case in cases_of(config, "objectives"):
        path = study.folder / "cases" / case.path
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(rated(case.material, case.resolution)))
    return study


def test_errors_are_pooled_as_root_mean_square_and_the_best_comes_first(study):
    rows = summary(study).rows
    assert [row["coarsening"] for row in rows] == ["good", "ddfem", "galerkin"]
    assert rows[0]["uniform_rms"] == pytest.approx(((0.03**2 + 0.015**2) / 2) ** 0.5)
    squares = [0.03**2, 0.015**2, 0.04**2, 0.02**2]
    assert rows[0]["all_rms"] == pytest.approx((sum(squares) / 4) ** 0.5)
    assert rows[0]["all_worst"] == pytest.approx(-0.06)
    assert rows[0]["all_where"] == "Box 8, noise, mode 9"
    assert rows[0]["uniform_where"] == "Box 8, uniform, mode 9"


def test_the_full_table_has_a_row_for_every_coarsening_of_every_case(study):
    rows = errors(study).rows
    assert len(rows) == 2 * 2 * 3
    assert rows[0]["audible_worst_mode"] == 9
    assert (rows[0]["last"], rows[-1]["last"]) == (66, 70)


def test_goals_are_met_only_if_every_case_keeps_the_limit(study):
    rms, share, worst, absent, _ = (judge(study, goal, "good") for goal in goals_of(study))
    assert (rms.met, rms.cases, rms.value) == (3, 4, 0.04) and not rms.passed
    assert str(rms).replace("\N{NO-BREAK SPACE}", " ") == "missed, 3 of 4 met"
    assert (share.met, share.cases) == (2, 2) and str(share) == "met"
    assert share.value == pytest.approx(0.5)
    assert (worst.met, worst.cases) == (1, 2) and worst.value == pytest.approx(0.06)
    assert str(absent) == "not studied" and not absent.passed
    good, _, galerkin = goals(study).rows
    assert good["met"] == "1 of 3" and galerkin["met"] == "0 of 3"
    assert len(goal_cases(study).rows) == 4 + 2 + 2 + 4


def test_forests_are_judged_by_the_fit_they_learned_on_every_solid(study):
    goal = goals_of(study)[-1]
    verdict = judge(study, goal, "ddfem")
    assert (verdict.met, verdict.cases, verdict.where) == (2, 4, "Box 8, noise")
    assert verdict.value == pytest.approx(1.2)
    assert goal.sentence.startswith("All solids: rms of the forests")
    for name in ("good", "galerkin"):
        assert str(judge(study, goal, name)) == "not studied"
    good, forests, _ = goals(study).rows
    assert good["goal4"] is None and good["goal3"] == "not studied"
    assert forests["goal4_where"] == "Box 8, noise"
    (box,) = forest(study).rows
    assert (box["cases"], box["where"]) == (4, "Box 8, noise")
    assert (box["median"], box["worst"]) == pytest.approx((1.1, 1.2))
    assert box["fit_rms"] == pytest.approx(summary(study).rows[0]["all_rms"])
    assert "good; default, SHA-256 0123" in description("ddfem", study.forest)


def test_without_forests_their_table_is_empty_and_the_reason_is_kept(study):
    for path in study.folder.rglob("*.json"):
        rating = json.loads(path.read_text())
        rows = [row for row in rating["rows"] if row["coarsening"] != "ddfem"]
        reason = "without ddfem: default.h5: no such file"
        path.write_text(
            json.dumps({**rating, "rows": rows, "forest": None, "without_forest": reason})
        )
    assert forest(study).rows == []
    assert study.without_forest == "without ddfem: default.h5: no such file"
    assert str(judge(study, goals_of(study)[-1], "good")) == "not studied"


def test_a_solid_without_its_mesh_is_left_out_and_named(study, tmp_path):
    assert study.solids == ["box"]
    assert list(solids.absent_meshes(study.config, "objectives")) == ["bust"]
    assert study.without.startswith(f"Without bust: there is no {tmp_path}/bust.obj")
    (tmp_path / "bust.obj").touch()
    assert study.without == ""
    assert len(cases_of(study.config, "objectives")) == 6


def test_coarse_models_with_fewer_modes_are_named(study):
    assert shortened(study) == ["Box 8, uniform (66 modes)", "Box 8, noise (66 modes)"]


@pytest.mark.parametrize("name", [*OBJECTIVES, "galerkin", "average"])
def test_every_objective_is_described_in_one_line(name):
    text = description(name)
    assert text and not any(mark in text for mark in ("\n", "`", "Objective"))


def test_an_unknown_objective_is_answered_in_one_sentence():
    config = settings.complete([LAPTOP])
    assert arguments(config)[-1] == ",".join(OBJECTIVES)
    config["objectives"]["objectives"] = ["guess"]
    with pytest.raises(UserError, match=r"objectives\.objectives\[0\]: found 'guess'"):
        completed(config)


def test_the_study_is_no_part_of_the_default_run(plan):
    default = plan()
    assert "find_modes" in default and "rate_objectives" not in default
    study = plan("objectives")
    # No mesh files lie here: box, bell and pan at two resolutions with five materials.
    assert study["rate_objectives"] == 3 * 2 * 5
    assert study["plot_objectives_solid"] == 3
    assert "find_modes" not in study


@pytest.fixture(scope="module")
def miniature(tmp_path_factory, run_cli):
    """Folder of the tiny study, with forests in it."""
    folder = tmp_path_factory.mktemp("study")
    config = yaml.safe_load(TINY.read_text())
    config["results_dir"] = "results"
    config["objectives"]["forest"] = str(train_small_forests(folder, run_cli))
    config["objectives"]["objectives"].append("calibrated")
    (folder / "config.yaml").write_text(yaml.safe_dump(config))
    finished(folder, "objectives", configfile=folder / "config.yaml")
    return folder / "results" / "objectives"


@pytest.mark.nightly
def test_the_page_of_a_miniature_study_holds_its_tables(miniature):
    hidden = {"errors": ("title", "unknowns", "coarse_unknowns"), "goal-cases": ("title",)}
    page = finished_page(DESCRIBED, miniature, **hidden)
    assert {"model-box", "plot-box"} <= set(page.ids)


@pytest.mark.nightly
def test_a_miniature_study_finds_that_a_fit_beats_galerkin(miniature):
    rows = {row["coarsening"]: row for row in read_table(miniature / "tables/summary.json").rows}
    assert rows["oversampled"]["all_rms"] < rows["galerkin"]["all_rms"]
    assert set(rows) == {"chen2015", "oversampled", "calibrated", "ddfem", "galerkin", "average"}
    (box,) = read_table(miniature / "tables/forest.json").rows
    assert 0.5 < box["median"] <= box["worst"] < 2.0
