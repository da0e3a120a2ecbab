"""Finite cells on thin walls are rated by references, on one lattice and on several."""

import json

import numpy as np
import pytest

from carillon.__main__ import main
from carillon.errors import UserError
from studies.accuracy.tetrahedra import missing
from studies.thin_walls.bounds import as_text as bounds_as_text
from studies.thin_walls.bounds import is_too_low, lowest_ratio
from studies.thin_walls.cells import tried_cells
from studies.thin_walls.measure import as_text
from studies.thin_walls.references import read_references
from studies.thin_walls.sizes import CELLS, TETRAHEDRA, WHOLE
from studies.thin_walls.solids import SOLIDS, STRAIGHT


def run(folder, *words):
    out = folder / "found.json"
    assert main(["study", *words, "--out", str(out)]) == 0
    return json.loads(out.read_text())


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """What the command writes of a plate, and of a mesh file without a reference."""
    folder = tmp_path_factory.mktemp("thin-walls")
    SOLIDS["fork"].surface().export(folder / "fork.stl")
    words = ["--solids", "plate-200", "--mesh", f"other={folder / 'fork.stl'}"]
    sizes = ["--resolution", "12", "--accuracy", "0", "--levels", "2"]
    return run(folder, "thin-walls", *words, *sizes)


def test_solids_are_rated_straight_and_turned(measured):
    straight, turned, *others = measured["solids"]
    assert (straight["position"], turned["position"]) == ("straight", "turned")
    for found in (straight, turned):
        assert 0.0 < found["rms"] <= found["worst"] and found["lowest"] > 0.999
        assert found["expected"] > 0.0 and found["ratio"] == found["expected"] / found["rms"]
        assert found["resolution"] == 12 and found["seconds"] > 0.0
        assert sum(found["divided"]) > 0
    assert all("rms" not in found and found["unknowns"] > 0 for found in others)


def test_sizes_have_rates(measured):
    kinds = {row["discretisation"]: row for row in measured["summary"]}
    assert set(kinds) == {CELLS, WHOLE, *([] if missing() else [TETRAHEDRA])}
    assert kinds[WHOLE]["rate"] > 1.0
    assert {level["solid"] for level in measured["levels"]} == {"plate-200"}
    text = as_text(measured)
    assert "Square plate, 1/200     straight" in text and "whole cells" in text


def test_an_accuracy_raises_the_resolution():
    reference = read_references()["plate"]
    solid = SOLIDS["plate"]
    left, raised = (
        tried_cells(solid, STRAIGHT, reference, 8, accuracy, 0.0) for accuracy in (None, 0.02)
    )
    assert left["resolution"] == 8 < raised["resolution"] and raised["expected"] < 0.02
    assert raised["rms"] < left["rms"]


def test_what_cannot_be_solved_leaves_a_sentence():
    found = tried_cells(SOLIDS["disc-500"], STRAIGHT, None, 4)
    assert "far thinner than the lattice spacing" in found["problem"]


def test_frequencies_are_bounds_from_above_wherever_the_lattice_lies(tmp_path):
    result = run(tmp_path, "thin-wall-bounds", "--solids", "box", "--resolution", "12")
    assert len(result["lattices"]) == 12
    for lattice in result["lattices"]:
        assert not is_too_low(lattice, result["doubts"])
    assert "Box" in bounds_as_text(result) and "too low" not in bounds_as_text(result)


def test_a_frequency_that_is_too_low_is_told():
    exact = 1.01 * read_references()["box"].hertz
    found = {"solid": "box", **lowest_ratio(SOLIDS["box"].surface(), "box", 8, 0.0, exact)}
    assert 0.98 < found["lowest"] < 0.995
    assert is_too_low(found, {"box": 1e-4}) and not is_too_low(found, {"box": 0.02})


def test_shifts_move_the_lattice_and_not_the_solid():
    solid, exact = SOLIDS["plate"].surface(), read_references()["plate"].hertz
    first, second = (lowest_ratio(solid, "plate", 10, shift, exact) for shift in (0.0, 0.4))
    assert first["lowest"] != second["lowest"]
    assert np.isclose(first["lowest"], second["lowest"], atol=0.05)


def test_lattices_that_are_no_use_are_refused():
    with pytest.raises(UserError):
        lowest_ratio(SOLIDS["wine-glass"].surface(), "wine-glass", 4, 0.0, np.ones(30))
