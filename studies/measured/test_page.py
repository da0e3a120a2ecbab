"""The study of measured frequencies: tables, figure and page from what the command measures."""

import json

import numpy as np
import pytest
import yaml

from studies.measured.config import MeasuredSolidsSection
from studies.measured.data_files import solid_names
from studies.measured.measure import CELLS, VOXELS, WITHOUT, MeasuredOptions, measured, rated
from studies.measured.results import MeasuredStudy
from studies.measured.solid import read_solid
from studies.measured.study import MEASURED
from studies.measured.verdict import DIFFERS
from tests.pages import assert_holds, page_of


def solids() -> list[dict]:
    """What `carillon study measured` would tell of a block, a plate and a solid that waits."""
    block = read_solid("titanium-block")
    told = measured("nafems-fv2-double-cross", read_solid("nafems-fv2-double-cross"), None)
    rows = [{**told, "solid": name, "title": name, "left_out": ""} for name in ("block", "plate")]
    for row, factor in zip(rows, (1.001, 1.02)):
        row |= {"hertz": block.hertz.tolist(), "uncertainty": 0.0025}
        found, expected = factor * block.hertz, np.full(30, 0.001)
        exact = rated(block, found, 1e-5, expected)
        cells = {"unknowns": 1000, "resolution": 24, **rated(block, found, 1e-3, expected)}
        problem = {"resolution": 24, "problem": "it is too thin"}
        row["models"] = [
            {"model": WITHOUT, "degrees": [14, 14, 14], **exact},
            {"model": CELLS, **cells},
            {"model": VOXELS, **problem},
        ]
    return [*rows, told]


@pytest.fixture
def study(tmp_path) -> MeasuredStudy:
    (tmp_path / "config.yaml").write_text(yaml.safe_dump({"results_dir": "results"}))
    found = MeasuredStudy(tmp_path / "measured")
    found.folder.mkdir()
    result = {"solids": solids(), "finer": 1.0, "refine_to": 0.002}
    result["provenance"] = {"commit": "none", "date": "2026-01-01"}
    (found.folder / "measured.json").write_text(json.dumps(result))
    return found


def test_the_page_holds_tables_and_figures(study):
    shown = page_of(MEASURED, study, study.folder / "report.html")
    assert_holds(shown, MEASURED, study.folder)
    assert (
        "it is too thin" in shown.source and "It lists motions in its plane alone" in shown.source
    )
    assert "agree with 1 of 2 solids" in shown.source and "differ from plate" in shown.source
    assert "studies/measured/data" in shown.source and "fit-constants" in shown.source


def test_the_table_has_the_verdicts(study):
    rows = MEASURED.made(study)["summary"].having({"model": CELLS})
    assert [row["verdict"] for row in rows][1] == DIFFERS


def test_the_configuration_names_what_the_command_does():
    part, defaults = MeasuredSolidsSection(), MeasuredOptions()
    assert part.solids == tuple(solid_names())
    assert (part.finer, part.refine_to) == (defaults.finer, defaults.refine_to)
