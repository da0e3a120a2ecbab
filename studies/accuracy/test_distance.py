"""Expected distances from the solid are set beside those from a finer lattice."""

import json

import pytest

from solver.__main__ import main
from studies.accuracy.distance import OBJECTS, as_text


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """What the command writes of a plate, straight and turned."""
    out = tmp_path_factory.mktemp("distance") / "plate.json"
    words = ["--turned", "--resolution", "8", "--reference", "12", "--out", str(out)]
    assert main(["distance", "builtin:plate", *words]) == 0
    return json.loads(out.read_text())


def test_every_way_is_rated_by_the_same_reference(measured):
    straight, turned = measured["solids"]
    assert (straight["solid"], turned["solid"]) == ("plate", "turned-plate")
    for solid in (straight, turned):
        ways = solid["ways"]
        assert ways["cells"]["unknowns"] < ways["divided"]["unknowns"]
        assert ways["divided"]["rms"] < ways["cells"]["rms"] < ways["voxels"]["rms"]
        assert solid["reference"]["doubt"] < 0.5 * ways["cells"]["rms"]
    assert turned["ways"]["voxels"]["rms"] < straight["ways"]["voxels"]["rms"]
    assert all(count == {"within": 2, "of": 2} for count in measured["right"].values())


def test_the_table_tells_both(measured):
    text = as_text(measured)
    assert "turned-plate" in text and text.count("2 of 2") == 3


def test_there_are_thirty_solids_with_those_that_are_turned():
    assert 2 * len(OBJECTS) >= 30


def test_a_reference_that_is_no_finer_gets_one_sentence(refuses):
    said = refuses(main, "distance", "builtin:bar", "--resolution", "16", "--reference", "16")
    assert "--reference 16 is no finer than --resolution 16" in said


def test_a_solid_that_cannot_be_measured_leaves_a_sentence():
    solid = {"solid": "flat", "problem": "it is flat", "ways": {}}
    counts = {way: {"within": 0, "of": 0} for way in ("cells", "divided", "voxels")}
    result = {"elastic_modes": 30, "resolution": 32, "solids": [solid], "right": counts}
    assert "it is flat" in as_text(result)
