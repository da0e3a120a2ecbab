"""Component modes that nothing corrects: off by some per cent, however few are wanted."""

import numpy as np
import pytest

from carillon.fem.geometry import builtin_surface, hexmesh_from_voxels, voxelize
from carillon.fem.materials import young_modulus
from carillon.fem.model import fine_model
from solver.analysis.modal_solver import modal_analysis
from solver.analysis.options import SolverOptions


@pytest.fixture(scope="module")
def bell():
    mesh = hexmesh_from_voxels(voxelize(builtin_surface("bell"), 20))
    return fine_model(mesh, young_modulus("smooth", mesh, 0, "bell"))


@pytest.mark.parametrize("modes", [12, 30, 64])
def test_frequencies_are_off_by_some_per_cent(bell, modes):
    options = SolverOptions(modes=modes, method="hcms", corrections=0, subdomains=16)
    found = modal_analysis(bell, options).values[6:]
    exact = modal_analysis(bell, SolverOptions(modes=modes)).values[6:]
    errors = np.sqrt(found / exact) - 1.0
    assert (errors > -1e-6).all()
    assert np.median(errors) < 0.1 and errors.max() < 0.3
