"""A bar has its frequencies, whichever way its mesh is written, turned or put together.

Mesh-free Rayleigh-Ritz of the free parallelepiped, 0.4 x 0.1 x 0.1 m of 1 GPa, 1000 kg/m^3 and
Poisson's ratio 0.25, gives 541.03 Hz for the first pair of bending modes.
"""

import pytest

from solver.analysis.library import solve
from solver.analysis.problem import ProblemOptions, build_problem
from tests.mesh_files import block, both_ways, concatenated, inside_out, saved, soup, with_turned
from tests.test_mesh_formats import BOX, FORMS, HALVES, quantised

RITZ = 541.03
ABOVE = {"voxel": 0.025, "finite-cell": 0.002}
"""How far above the pair is, of 4 voxels across (553.08 Hz) and 2 cells across (541.55 Hz)."""


def written(name, folder):
    """The path of a mesh of the bar."""
    if name == "counting back":
        path = folder / "bar.obj"
        path.write_text(FORMS[name])
        return str(path)
    if name == "quantised":
        return quantised(5122, True, 8)[0].written(folder / "bar.glb")
    left, right = HALVES
    touching = (
        block((-0.2, -0.05, -0.05), (0.0, 0.05, 0.05)),
        block((0.0, -0.05, -0.05), (0.2, 0.05, 0.05)),
    )
    surface = {
        "as it should be": BOX,
        "one face turned": with_turned(BOX, 4),
        "soup, three faces turned": soup(with_turned(BOX, 1, 4, 10)),
        "a side both ways": both_ways(BOX, 4, 5),
        "a part inside out": concatenated(left, inside_out(right)),
        "a part that touches inside out": concatenated(touching[0], inside_out(touching[1])),
    }[name]
    return saved(surface, folder / "bar.ply")


@pytest.mark.parametrize("discretisation", ABOVE)
@pytest.mark.parametrize(
    "name",
    [
        *("as it should be", "one face turned", "soup, three faces turned", "a side both ways"),
        *("a part inside out", "a part that touches inside out", "counting back", "quantised"),
    ],
)
def test_the_first_pair_of_bending_modes_is_that_of_the_bar(tmp_path, name, discretisation):
    options = ProblemOptions(written(name, tmp_path), 16, discretisation=discretisation)
    found = solve(build_problem(options).model, modes=9, method="slepc").frequencies[6:8]
    assert found[1] == pytest.approx(found[0], rel=1e-3)
    assert RITZ < found[0] < (1.0 + ABOVE[discretisation]) * RITZ
