"""Steps of a design that paints one part of a solid, by each method."""

import numpy as np
import pytest

from solver.correction.criteria import INTERACTIVE_TOLERANCE
from studies.painted.measure import METHODS, PaintedOptions, follow, lines_of
from tests import solids


@pytest.fixture(scope="module")
def result():
    model = solids.random_box(12, 6, 5)
    young = np.full(model.mesh.n_cells, 1e9)
    return follow(model, young, PaintedOptions(modes=20, steps=3))


def test_every_method_tells_its_seconds_and_errors(result):
    assert list(result["methods"]) == list(METHODS)
    for each in result["methods"].values():
        assert len(each["seconds"]) == 3 and min(each["seconds"]) > 0.0
        assert each["first"] == each["seconds"][0] and each["following"] == each["seconds"][2]
        assert 0.0 <= each["median_error"] <= each["largest_error"]
    errors = {name: each["largest_error"] for name, each in result["methods"].items()}
    assert errors["block Lanczos"] < INTERACTIVE_TOLERANCE < errors["HCMS"] < 0.5


def test_the_table_has_a_line_a_method(result):
    first, _, *lines = lines_of(result)
    assert first.startswith("1,638 unknowns, 20 modes")
    assert [line[:14].strip() for line in lines] == list(METHODS)
