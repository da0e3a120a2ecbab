"""The study of discretisations: pooling, what a case shows, the page, the rules."""

import json

import pytest
import yaml

from carillon.records.measurement import measured
from studies.base.cases import cases_of
from studies.discretisation.results import DiscretisationStudy
from studies.discretisation.study import DISCRETISATION
from studies.discretisation.tables import WAYS
from tests.pages import assert_holds, page_of

summary, cases, truths = (DISCRETISATION.entries[name] for name in ("summary", "cases", "truths"))
MODEL = {"title": "", "mesh": "builtin:fork", "resolutions": [8], "components": "error"}
STUDY = {
    "models": {"fork": MODEL, "comb": {**MODEL, "mesh": "builtin:comb"}},
    "materials": ["smooth", "noise"],
    "modes": 20,
    "runs": 3,
}
RMS = {"fork": 0.03, "comb": 0.04}


def rated(solid: str, material: str) -> dict:
    """What `solver discretisation` would write."""

    def way(share: float) -> dict:
        errors = {"rms": share * RMS[solid], "worst": -2.0 * share * RMS[solid], "worst_mode": 9}
        return {
            "n_dofs": int(1000 * share),
            "seconds": share,
            "spread": {"min": 0.9 * share, "max": 1.2 * share},
            "phases": dict.fromkeys(("mesh", "material", "model", "solve"), share / 4),
            "against": {"solid": errors, "voxels": errors},
        }

    names = [name for name in WAYS if material == "noise" or name != "half-cells-harmonic"]
    return {
        "tolerance": 1e-6,
        "truth": {"n_dofs": 9000, "doubt_rms": 0.01, "doubt_worst": 0.02},
        "ways": {name: way(1.0 if name == "voxels" else 0.5) for name in names},
        "provenance": measured({"command": "discretisation"}),
    }


@pytest.fixture
def study(tmp_path) -> DiscretisationStudy:
    """A study of two solids."""
    config = {"mesh_folder": str(tmp_path), "results_dir": "results", "discretisation": STUDY}
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(config, sort_keys=False))
    found = DiscretisationStudy(tmp_path / "discretisation")
    for case in cases_of(config, "discretisation"):
        path = found.folder / "cases" / case.path
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(rated(case.solid, case.material)))
    return found


def test_errors_are_pooled_by_material_and_way(study):
    rows = summary(study).rows
    assert len(rows) == 6 + 7
    voxels, coarse = rows[:2]
    assert voxels["material"] == "smooth" and voxels["way"] == "Voxels"
    assert voxels["solid_rms"] == pytest.approx(((0.03**2 + 0.04**2) / 2) ** 0.5)
    assert voxels["solid_median"] == pytest.approx(0.035)
    assert voxels["solid_worst"] == pytest.approx(-0.08)
    assert voxels["solid_where"] == "Comb 8, smooth, mode 9"
    assert (coarse["n_dofs"], coarse["seconds"], coarse["doubt"]) == (0.5, 0.5, 0.01)


def test_every_case_has_a_row_a_way(study):
    rows = cases(study).rows
    assert len(rows) == 2 * (6 + 7)
    assert {row["name"] for row in rows if row["material"] == "noise"} == set(WAYS)
    assert (rows[0]["seconds"], rows[0]["seconds_min"], rows[0]["seconds_max"]) == (1.0, 0.9, 1.2)
    assert rows[0]["unknowns"] == 1000 and rows[0]["solid_rms"] == 0.03
    assert [row["doubt_rms"] for row in truths(study).rows] == [0.01] * 4


def test_the_page_holds_its_tables_and_figures(study):
    page = page_of(DISCRETISATION, study, study.folder / "report.html")
    assert_holds(page, DISCRETISATION, study.folder)


def test_a_target_makes_the_study(plan):
    found = plan("discretisation")
    # No mesh files lie here: six built-in solids with four materials.
    assert found["rate_discretisation"] == 6 * 4
    assert "find_modes" not in found and "rate_coarsening" not in found
