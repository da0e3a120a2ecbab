"""Finite cells of two materials, free and held, agree with polynomials in layers."""

import numpy as np
import pytest
import trimesh
import yaml

from carillon.fem.elasticity import elasticity_matrix
from solver.analysis.problem import ProblemOptions
from studies.accuracy.anisotropic_box import BoxLayer, layered_eigenvalues
from studies.accuracy.expected import elastic_hertz, expected_errors, solved_solid

SIDES = (0.10, 0.08, 0.24)
SOFT, STIFF = (2e9, 0.3, 1000.0), (1e10, 0.2, 3000.0)
"""Young's modulus [Pa], Poisson's ratio and density [kg/m^3] below and above the border."""
COUNT = 12
FACE = [{"where": "z < -0.1199999 and z > -0.1200001"}]
"""The face of least z alone."""


def layer(thickness: float, young: float, poisson: float, density: float) -> BoxLayer:
    return BoxLayer(thickness, young * elasticity_matrix(poisson), density)


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("lower", [0.12, 0.097])
def test_cells_of_two_materials_agree_with_layers(tmp_path, lower, held):
    """The second border lies between the planes of the lattice, and strains jump within cells."""
    x, y, z = SIDES
    layers = [layer(lower, *SOFT), layer(z - lower, *STIFF)]
    values = layered_eigenvalues((x, y), (7, 7, 12), layers, clamped=held)
    first = 0 if held else 6
    exact = np.sqrt(values[first : first + COUNT]) / (2.0 * np.pi)
    trimesh.creation.box(extents=SIDES).export(tmp_path / "box.stl")
    names = ("young", "poisson", "density")
    regions = [
        {"name": "soft", **dict(zip(names, SOFT))},
        {"name": "stiff", **dict(zip(names, STIFF)), "where": f"z > {lower - z / 2.0:.6f}"},
    ]
    document = {"regions": regions, "supports": FACE if held else []}
    (tmp_path / "regions.yaml").write_text(yaml.safe_dump(document))
    described = ProblemOptions(
        str(tmp_path / "box.stl"),
        24,
        discretisation="finite-cell",
        regions=str(tmp_path / "regions.yaml"),
    )
    solved = solved_solid(described, 6 + COUNT, 0.01)
    assert solved.modes.rigid == first
    errors = elastic_hertz(solved, COUNT) / exact - 1.0
    expected = np.sqrt(np.mean(expected_errors(solved)[:COUNT] ** 2))
    assert np.sqrt(np.mean(errors**2)) < 3.0 * expected < 0.03
