"""The study of thin walls: tables, figures and page from what the commands measure."""

import json

import pytest
import yaml

from studies.accuracy.measure import summarised
from studies.thin_walls import plots
from studies.thin_walls.config import ThinWallsSection
from studies.thin_walls.measure import AIMS, MOST_UNKNOWNS, ThinWallOptions
from studies.thin_walls.results import ThinWallStudy
from studies.thin_walls.sizes import CELLS, TETRAHEDRA, WHOLE
from studies.thin_walls.solids import SOLIDS
from studies.thin_walls.study import THIN_WALLS
from tests.pages import assert_holds, page_of

KINDS = {"ring": "thin", "wine-glass": "thin", "box": "thick", "teapot": "file"}
PROVENANCE = {"commit": "none", "date": "2026-01-01"}


def found(solid: str, rms: float) -> dict:
    sizes = {"resolution": 32, "unknowns": 20_000, "divided": [300, 80], "seconds": 12.0}
    told = {"expected": 0.012, "expected_worst": 0.03}
    errors = {"rms": rms, "worst": 2.5 * rms, "worst_mode": 9, "lowest": 1.001, "ratio": 1.2}
    return {"solid": solid, "position": "turned", **sizes, **told, **errors}


def measured(levels: list[dict], without: str) -> dict:
    solids = [found("ring", 0.005), found("wine-glass", 0.02), found("box", 0.001)]
    unrated = {key: solids[0][key] for key in ("resolution", "unknowns", "divided", "seconds")}
    solids += [{"solid": "teapot", "position": "straight", **unrated, "expected": None}]
    solids += [{"solid": "ring", "position": "straight", "problem": "the lattice is too coarse"}]
    reference = {"method": "harmonics", "how": "triangles of 1 mm", "doubt": 1e-4}
    return {
        "elastic_modes": 30,
        "resolution": 32,
        "accuracy": 0.01,
        "aims": AIMS,
        "most_unknowns": MOST_UNKNOWNS,
        "titles": {name: name.capitalize() for name in KINDS},
        "kinds": KINDS,
        "walls": dict.fromkeys(KINDS, 0.005) | {"teapot": None},
        "references": {"ring": {**reference, "hertz": [10.0, 20.0]}},
        "solids": solids,
        "levels": levels,
        "summary": summarised(levels),
        "facets": {"title": "Ring", "sections": 288, "change": 7e-5},
        "without": without,
        "packages": {} if without else {"gmsh": "4.15", "scikit-fem": "12.0"},
        "provenance": PROVENANCE,
    }


def over_size(kinds: tuple[str, ...]) -> list[dict]:
    return [
        {
            "solid": solid,
            "discretisation": kind,
            "spacing": 0.02 / finer,
            "unknowns": 1000 * finer**3,
            "seconds": 0.1 + finer,
            "rms": 0.1 / finer**order,
            "worst": 0.3 / finer**order,
            "worst_mode": 9,
        }
        for solid in ("ring", "wine-glass")
        for order, kind in enumerate(kinds, start=1)
        for finer in (1, 2, 4)
    ]


def bounds() -> dict:
    lattices = [
        {"solid": "ring", "resolution": 16, "shift": shift, "unknowns": 9, "lowest": low, "mode": 7}
        for shift, low in ((0.0, 1.01), (0.5, 0.99))
    ]
    lattices += [{"solid": "box", "resolution": 16, "shift": 0.0, "lowest": 1.0, "mode": 8}]
    lattices += [{"solid": "wine-glass", "resolution": 16, "shift": 0.0, "problem": "too thin"}]
    return {
        "elastic_modes": 30,
        "position": "straight",
        "allowed": 0.001,
        "doubts": dict.fromkeys(("ring", "box", "wine-glass"), 1e-4),
        "titles": {"ring": "Ring", "box": "Box", "wine-glass": "Wine glass"},
        "lattices": lattices,
        "provenance": PROVENANCE,
    }


@pytest.fixture(params=["all", "no tetrahedra", "no sizes"])
def study(request, tmp_path) -> ThinWallStudy:
    kinds = {"all": (CELLS, WHOLE, TETRAHEDRA), "no tetrahedra": (CELLS, WHOLE)}
    without = "Without tetrahedra: none are here." if request.param == "no tetrahedra" else ""
    levels = over_size(kinds.get(request.param, ()))
    (tmp_path / "config.yaml").write_text(yaml.safe_dump({"results_dir": "results"}))
    found = ThinWallStudy(tmp_path / "thin_walls")
    found.folder.mkdir()
    (found.folder / "thin_walls.json").write_text(json.dumps(measured(levels, without)))
    (found.folder / "bounds.json").write_text(json.dumps(bounds()))
    return found


def test_the_page_holds_tables_and_figures(study):
    shown = page_of(THIN_WALLS, study, study.folder / "report.html")
    if study.over_size:
        assert_holds(shown, THIN_WALLS, study.folder)
        assert ("Gmsh 4.15" in shown.source) == (study.without == "")
    assert "the lattice is too coarse" in shown.source
    assert "1 of 4 models of thin walls" in shown.source.replace("\N{NO-BREAK SPACE}", " ")


def test_verdicts_name_what_is_missed(study):
    verdicts = {row["title"]: row["verdict"] for row in study.of_kind("thin", "thick", "file")[:4]}
    assert verdicts["Wine-glass"] == "missed: rms, worst" and verdicts["Box"] == "met"
    assert study.of_kind("file")[0]["verdict"] == "no reference"
    assert study.lowest("ring")["verdict"] == "too low" and study.lowest("ring")["shift"] == 0.5
    assert study.lowest("wine-glass")["verdict"] == "no model"


def test_convergence_is_shown_of_a_smooth_wall_and_of_a_joint():
    assert set(plots.SMOOTH + plots.JOINED) <= set(SOLIDS)


def test_the_configuration_names_what_the_command_does():
    part, defaults = ThinWallsSection(), ThinWallOptions()
    assert part.solids == tuple(SOLIDS) and part.levels == defaults.levels
    assert (part.resolution, part.accuracy) == (defaults.resolution, defaults.accuracy)
