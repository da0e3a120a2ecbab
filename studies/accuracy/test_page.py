"""The study of the discretisations: tables, figures and page from what the command measures."""

import json

import pytest
import yaml

from studies.accuracy.config import AccuracySection
from studies.accuracy.measure import AccuracyOptions, summarised
from studies.accuracy.results import AccuracyStudy
from studies.accuracy.solids import SOLIDS
from studies.accuracy.study import ACCURACY
from studies.accuracy.tables import LABELS
from tests.pages import assert_holds, page_of

KINDS = list(LABELS)


def measured(kinds: list[str]) -> dict:
    """What `solver accuracy` would tell of a plate that falls apart in coarse voxels."""
    levels = [
        {
            "solid": "plate",
            "discretisation": kind,
            "spacing": 0.02 / finer,
            "unknowns": 1000 * finer**3,
            "build_seconds": 0.1,
            "solve_seconds": float(finer),
            "seconds": 0.1 + finer,
            "rms": 0.1 / finer**order,
            "worst": 0.3 / finer**order,
            "worst_mode": 9,
        }
        for order, kind in enumerate(kinds, start=1)
        for finer in (1, 2, 4)
    ]
    levels[0] = {key: levels[0][key] for key in ("solid", "discretisation", "spacing")}
    levels[0]["problem"] = "the solid is in 5 pieces"
    reference = {"title": "A plate", "degrees": [9, 9, 3], "change": 1e-5}
    return {
        "elastic_modes": 30,
        "angles": [25.0, 35.0, 15.0],
        "runs": 3,
        "without": "" if len(kinds) == len(KINDS) else "Without tetrahedra: none are here.",
        "packages": {"gmsh": "4.15", "scikit-fem": "12.0"},
        "references": {"plate": {**reference, "frequencies": [100.0, 900.0]}},
        "levels": levels,
        "summary": summarised(levels),
        "provenance": {"commit": "none", "date": "2026-01-01"},
    }


@pytest.fixture(params=[KINDS, KINDS[:2]], ids=["all", "no tetrahedra"])
def study(request, tmp_path) -> AccuracyStudy:
    (tmp_path / "config.yaml").write_text(yaml.safe_dump({"results_dir": "results"}))
    found = AccuracyStudy(tmp_path / "accuracy")
    found.folder.mkdir()
    (found.folder / "accuracy.json").write_text(json.dumps(measured(request.param)))
    return found


def test_the_page_holds_tables_and_figures(study):
    shown = page_of(ACCURACY, study, study.folder / "report.html")
    assert_holds(shown, ACCURACY, study.folder)
    assert "the solid is in 5 pieces" in shown.source
    assert ("Gmsh 4.15" in shown.source) == (study.without == "")


def test_the_configuration_names_what_the_command_does():
    part, defaults = AccuracySection(), AccuracyOptions()
    assert part.solids == tuple(SOLIDS) and part.levels == defaults.levels
    assert part.runs == defaults.runs
