"""The study of the worst modes: pooling, verdicts, the worst of a solid, a miniature end to end."""

import json

import numpy as np
import pytest
import yaml

from carillon.drawing.solid import looks_at
from studies.base.cases import Case, cases_of
from studies.base.table import read_table
from studies.coarsening.pictures import best_view
from studies.coarsening.results import CoarseningStudy
from studies.coarsening.study import COARSENING
from studies.coarsening.tables import filled_cells, rank_correlation, speeds
from tests import solids
from tests.pages import finished_page
from tests.workflow_runs import LAPTOP, finished
from workflow import settings

summary, cases, modes, elements, costs = (
    COARSENING.entries[name] for name in ("summary", "cases", "modes", "elements", "costs")
)
STUDY = {
    "models": {
        "fork": {"title": "", "mesh": "builtin:fork", "resolutions": [8], "components": "error"},
        "bust": {"title": "", "mesh": "bust.obj", "resolutions": [24], "components": "error"},
    },
    "materials": ["uniform", "noise"],
    "modes": 20,
    "refine_to": 0.05,
}
RMS = {"uniform": 0.06, "noise": 0.20}


def far_off(mode: int, verdict: str, error: float) -> dict:
    """A mode as `solver coarsening` would tell of it."""
    element = {"place": [0.1, 0.2, 0.3], "pattern": 0b00010111, "cells": 4}
    return {
        "mode": mode,
        "verdict": verdict,
        "error": error,
        "half_of_energy": 0.1,
        "elements": [{**element, "energy": 0.2, "blame": 0.5, "share": 0.04}],
    }


def rated(material: str) -> dict:
    """What it would write: a quarter of the error where blocks stay fine."""

    def model(rms: float, far: list[dict]) -> dict:
        errors = {"first": 7, "last": 20, "rms": rms, "worst": -1.5 * rms, "worst_mode": 9}
        expected = {**errors, "rms": 1.1 * rms}
        shapes = {**errors, "modes": 12}
        return {"by_index": errors, "expected": expected, "recognised": shapes, "far_off": far}

    def spent(faster: float) -> dict:
        cost = {"processor_seconds": 2.0, "seconds": 2.1}
        taken = {"modes": 60, "taken": "fine", "reason": "so", "estimates": 0}
        return {**taken, "fine": cost, "coarse": cost, "faster": faster}

    rms = RMS[material]
    far = [far_off(9, "swap", -0.30), far_off(12, "local", 0.12 if material == "noise" else 0.15)]
    return {
        "n_dofs": 300,
        "goals": {"rms": 0.05, "worst": 0.15, "far_off": 0.1},
        "plain": model(rms, far),
        "refined": model(rms / 4, []),
        "costs": {"auto": spent(1.0 + rms), "slepc": spent(3.0)},
        "provenance": {"commit": "none"},
    }


@pytest.fixture
def study(tmp_path) -> CoarseningStudy:
    """A study of a fork, whose other solid has no mesh."""
    config = {"mesh_folder": str(tmp_path), "results_dir": "results", "coarsening": STUDY}
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(config))
    found = CoarseningStudy(tmp_path / "coarsening")
    for case in cases_of(config, "coarsening"):
        path = found.folder / "cases" / case.path
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(rated(case.material)))
    return found


def test_errors_are_pooled_and_verdicts_counted(study):
    plain, refined = summary(study).rows
    assert plain["all_rms"] == pytest.approx(((0.06**2 + 0.20**2) / 2) ** 0.5)
    assert plain["all_worst"] == pytest.approx(-0.30)
    assert plain["all_where"] == "Fork 8, noise, mode 9"
    assert (plain["far_off"], plain["swap"], plain["local"], plain["error"]) == (4, 2, 2, 0)
    assert (refined["far_off"], refined["local"]) == (0, 0)
    assert (plain["met"], refined["met"], refined["cases"]) == (0, 2, 2)


def test_every_case_has_a_row_with_both_models(study):
    rows = cases(study).rows
    assert [(row["title"], row["material"]) for row in rows] == [
        ("Fork", "uniform"),
        ("Fork", "noise"),
    ]
    assert rows[1]["plain_rms"] == 0.20 and rows[1]["refined_rms"] == 0.05
    assert rows[1]["plain_expected_rms"] == pytest.approx(0.22)
    assert rows[1]["plain_shape_modes"] == 12 and rows[1]["plain_far_off"] == 2


def test_costs_stand_beside_those_of_the_fine_solid(study):
    row = costs(study).rows[1]
    assert row["auto_fine"] == row["auto_coarse"] == 2.0 and row["slepc_faster"] == 3.0
    assert (row["auto_taken"], row["auto_reason"], row["auto_modes"]) == ("fine", "so", 60)


def test_speeds_are_told_by_method(study):
    assert speeds(study, "auto") == pytest.approx({"median": 1.13, "least": 1.06, "most": 1.2})
    assert speeds(study, "slepc")["median"] == 3.0


def test_expected_errors_in_the_order_of_the_true_ones_correlate(study):
    assert rank_correlation(study) == pytest.approx(1.0)


def test_the_worst_mode_of_a_solid_is_no_swapped_one_if_there_is_another(study):
    case, mode = study.worst_of("fork")
    assert case == Case("fork", 8, "uniform") and mode["mode"] == 12
    assert study.worst_of("bust") is None
    assert study.pictures_of(case) == study.folder / "cases" / "fork" / "8-uniform.h5"


def test_elements_and_modes_have_rows_of_their_own(study):
    assert [row["mode"] for row in modes(study).rows] == [9, 12, 9, 12]
    row = elements(study).rows[0]
    assert (row["x"], row["z"], row["rank"], row["of"]) == (0.1, 0.3, 1, "Coarse")
    assert row["pattern"] == filled_cells(0b00010111) == "●●●○ ●○○○"


def test_a_solid_without_its_mesh_is_left_out_and_named(study, tmp_path):
    assert study.solids == ["fork"]
    assert study.without.startswith(f"Without bust: there is no {tmp_path}/bust.obj")


def test_the_study_is_no_part_of_the_default_run(plan):
    default = plan()
    assert "find_modes" in default and "rate_coarsening" not in default
    study = plan("coarsening")
    # No mesh files lie here: four built-in solids and eight trial solids with two materials.
    assert study["rate_coarsening"] == 12 * 2
    assert "find_modes" not in study and "rate_objectives" not in study


def test_the_trial_solids_are_all_studied():
    from carillon.fem.geometry.builtin import TRIALS

    config = settings.complete([LAPTOP])
    meshes = [model["mesh"] for model in config["coarsening"]["models"].values()]
    assert {f"builtin:{name}" for name in TRIALS} <= set(meshes)


@pytest.mark.parametrize("side", [(0, 1), (0, -1), (1, 1), (1, -1), (2, -1)])
def test_a_mode_is_seen_from_where_its_energy_is(side):
    axis, sign = side
    mesh = solids.box_mesh(8, 8, 8)
    lit = mesh.grid[:, axis] == (7 if sign > 0 else 0)
    outward = sign * np.eye(3)[[axis]]
    view = best_view(mesh, lit.astype(float), "z")
    assert looks_at(mesh, outward, view, "z")[0] > 0.3


@pytest.fixture(scope="module")
def miniature(tmp_path_factory):
    """Folder of the tiny study."""
    return finished(tmp_path_factory.mktemp("study"), "coarsening") / "results-tiny/coarsening"


@pytest.mark.nightly
def test_the_page_of_a_miniature_study_holds_its_tables(miniature):
    shown = ("summary", "cases", "truths", "costs", "provenance")
    page = finished_page(COARSENING, miniature, shown)
    assert "model-dumbbell" in page.ids and page.source.count("data:image/png") == 2


@pytest.mark.nightly
def test_a_miniature_study_is_refined_to_its_goals(miniature):
    plain, refined = read_table(miniature / "tables/summary.json").rows
    assert refined["all_rms"] <= 0.05 < plain["all_rms"]
    assert refined["met"] == refined["cases"] == 2 and plain["far_off"] > 0
    for case in (miniature / "cases" / "dumbbell").glob("*.json"):
        content = json.loads(case.read_text())
        assert (content["resolution"], content["modes"], content["coarsen"]) == (12, 24, "ddfem")
