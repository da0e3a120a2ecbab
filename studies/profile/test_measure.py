"""The profile of a solve: its phases, their work, and what is left of the whole."""

import numpy as np
import pytest

from carillon.errors import UserError
from carillon.fem.geometry import builtin_surface, hexmesh_from_voxels, voxelize
from carillon.fem.model import fine_model
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.options import SolverOptions
from studies.profile.measure import ProfileOptions, profile, profile_lines


@pytest.fixture(scope="module")
def bar():
    mesh = hexmesh_from_voxels(voxelize(builtin_surface("bar"), 16))
    return fine_model(mesh, np.full(mesh.n_cells, 1e9))


@pytest.mark.nightly
def test_phases_tell_their_work_and_what_the_machine_can_do(bar):
    found = profile(bar, ProfileOptions(modes=24, runs=2))
    columns, phases = found["right_hand_sides"], found["phases"]
    assert columns >= 24 and columns <= found["block"] * -(-columns // found["block"])
    # A dense solve takes 2 n^2 operations, n^3 / 3 the factorisation: sparse ones take less.
    assert 0 < phases["solves"]["operations"] < 2.0 * found["n_dofs"] ** 2 * columns
    assert 0 < phases["factorisation"]["operations"] < found["n_dofs"] ** 3 / 3.0
    assert all(phase["seconds"] >= 0.0 for phase in phases.values())
    assert found["gflops_dgemm"] > 0.1 and found["gbytes_memory"] > 0.1
    lines = profile_lines(found)
    assert lines[0].startswith(f"{bar.n_dofs:,} unknowns, 24 modes: {columns} right-hand sides")
    assert [line.split("  ")[0] for line in lines[2:-2]] == list(phases)
    assert lines[-1].startswith("whole solve")


def test_what_no_factorisation_fits_is_refused(bar, monkeypatch):
    monkeypatch.setattr("solver.linear.rank_tree.available_memory", lambda: 1)
    assert ModalSolver(bar, SolverOptions(modes=24)).options.method == "lobpcg"
    with pytest.raises(UserError, match="too many to be factorised .* lower --resolution"):
        profile(bar, ProfileOptions(modes=24, runs=1))
