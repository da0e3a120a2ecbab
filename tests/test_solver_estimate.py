"""Expected errors of coarse models, and models that are refined until they are small."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.stats import spearmanr

from carillon.errors import UserError
from carillon.fem.geometry import blocks_from_mesh
from carillon.fem.materials import young_modulus
from carillon.fem.model import RIGID_MODES, fine_model
from solver.__main__ import main
from solver.analysis.modal_solver import modal_analysis
from solver.analysis.options import SolverOptions
from solver.analysis.problem import ProblemOptions, build_problem
from solver.coarsening.choice import make_coarsening
from solver.coarsening.model import coarse_model, element_moduli
from solver.files.modes_file import read_modes
from solver.refinement.energies import element_energies, fine_energies
from solver.refinement.errors import ExpectedErrors
from solver.refinement.estimate import estimate_errors
from solver.refinement.options import ALLOWED_ERROR, RefinementOptions
from solver.refinement.two_grid import TwoGrid
from tests.rank_counts import TO_THREE


def solved(model, modes=60):
    """Eigenvalues and modes in mesh order, by SLEPc."""
    result = modal_analysis(model, SolverOptions(method="slepc", modes=modes))
    vectors = result.system.gather(result.vectors)
    result.destroy()
    return result.values, vectors


@pytest.fixture(scope="module", params=["fork:uniform", "dumbbell:noise"])
def solid(request):
    """Fine model, its exact eigenvalues, coarse blocks, coarse model and its modes."""
    name, material = request.param.split(":")
    problem = build_problem(ProblemOptions(f"builtin:{name}", 24, material))
    fine = problem.model
    blocks, coarsening = blocks_from_mesh(problem.fine), make_coarsening("ddfem")
    moduli = element_moduli(blocks, problem.young, coarsening)
    coarse = coarse_model(blocks, moduli, coarsening.lumped_fraction)
    return fine, solved(fine)[0], blocks, coarse, *solved(coarse)


def test_values_come_from_above_and_near(solid):
    fine, exact, blocks, _, _, modes = solid
    two_grid, elastic = TwoGrid(fine), np.ascontiguousarray(modes[:, RIGID_MODES:])
    worst = []
    for steps in range(5):
        values, vectors = two_grid.lowest(blocks, elastic, steps)
        assert (values >= exact[RIGID_MODES:] * (1.0 - 1e-9)).all()
        worst.append(np.median(values / exact[RIGID_MODES:] - 1.0))
        gram = vectors.T @ two_grid.system.times_mass(vectors)
        assert np.abs(gram - np.eye(len(values))).max() < 1e-8
    assert (np.diff(worst) < 0.0).all()
    assert worst[3] < 0.01


def test_expected_errors_are_near_the_true_ones(solid):
    fine, exact, blocks, coarse, values, modes = solid
    estimate = estimate_errors(TwoGrid(fine), blocks, coarse, values, modes)
    true = np.sqrt(values[RIGID_MODES:] / exact[RIGID_MODES:]) - 1.0
    errors = estimate.errors.errors
    assert errors.shape == true.shape
    rms = np.sqrt(np.mean(true**2))
    assert abs(estimate.errors.rms - rms) < 0.2 * rms
    assert spearmanr(errors, true)[0] > 0.9
    assert estimate.shares.shape == (blocks.coarse.n_cells,)
    assert (estimate.shares >= 0.0).all()


def test_nothing_is_missed_where_all_is_fine():
    problem = build_problem(ProblemOptions("builtin:fork", 24))
    plain = blocks_from_mesh(problem.fine)
    blocks = blocks_from_mesh(problem.fine, np.ones(plain.coarse.n_cells, dtype=bool))
    coarsening = make_coarsening("ddfem")
    moduli = element_moduli(blocks, problem.young, coarsening)
    coarse = coarse_model(blocks, moduli, coarsening.lumped_fraction)
    values, modes = solved(coarse, 40)
    estimate = estimate_errors(TwoGrid(problem.model), blocks, coarse, values, modes)
    assert np.abs(estimate.errors.errors).max() < 1e-6
    assert estimate.shares.max() == 0.0


def test_energies_of_elements_sum_to_those_of_modes():
    problem = build_problem(ProblemOptions("builtin:bar", 12, "noise"))
    values, modes = solved(problem.model, 20)
    energies = element_energies(problem.model, modes)
    np.testing.assert_allclose(energies.sum(axis=0)[6:], values[6:], rtol=1e-8)
    blocks = blocks_from_mesh(problem.fine)
    assert fine_energies(blocks, problem.model, modes).shape == (blocks.coarse.n_cells, 20)
    np.testing.assert_allclose(
        fine_energies(blocks, problem.model, modes).sum(axis=0)[6:], values[6:], rtol=1e-8
    )


def test_energies_scale_with_the_modulus():
    problem = build_problem(ProblemOptions("builtin:bar", 12))
    mesh = problem.fine
    stiff = fine_model(mesh, 4.0 * young_modulus("uniform", mesh))
    motion = np.random.default_rng(0).standard_normal((mesh.n_dofs, 2))
    np.testing.assert_allclose(
        element_energies(stiff, motion), 4.0 * element_energies(problem.model, motion)
    )


def test_excess_counts_the_rms_and_a_third_of_the_worst():
    even = ExpectedErrors(np.array([0.1, -0.1]))
    assert even.excess(0.1) == pytest.approx(1.0)
    spiked = ExpectedErrors(np.array([0.0] * 99 + [-0.6]))
    assert spiked.excess(0.1) == pytest.approx(2.0)
    assert (spiked.worst, spiked.worst_mode) == (-0.6, 106)


def test_frequencies_are_as_near_as_was_asked_for(tmp_path):
    out, truth = str(tmp_path / "modes.h5"), str(tmp_path / "truth.h5")
    solid = ["builtin:dumbbell", "--resolution", "24", "--material", "noise", "--modes", "60"]
    for tolerance in (0.05, 0.02):
        main(["modes", *solid, "--coarsen", "ddfem", "--refine-to", str(tolerance), "--out", out])
        main(["modes", *solid, "--method", "slepc", "--out", truth])
        file, exact = read_modes(out), read_modes(truth)
        errors = np.sqrt(file.eigenvalues[6:] / exact.eigenvalues[6:]) - 1.0
        assert np.sqrt(np.mean(errors**2)) < tolerance
        assert np.abs(errors).max() < 3.0 * tolerance
        assert file.attributes["expected_frequency_error_rms"] <= tolerance
        assert 0 < file.attributes["fine_blocks"] < 164
    assert file.mesh.n_nodes < exact.mesh.n_nodes


def test_a_refined_model_is_started_from(tmp_path):
    first, again = str(tmp_path / "first.h5"), str(tmp_path / "again.h5")
    solid = ["builtin:dumbbell", "--resolution", "24", "--material", "noise", "--modes", "40"]
    main(["modes", *solid, "--coarsen", "ddfem", "--out", first])
    main(["modes", *solid, "--coarsen", "ddfem", "--initial-modes", first, "--out", again])
    before, after = read_modes(first), read_modes(again)
    assert before.attributes["refinement_steps"] > 0 == after.attributes["refinement_steps"]
    np.testing.assert_array_equal(before.mesh.cells, after.mesh.cells)
    np.testing.assert_allclose(before.eigenvalues[6:], after.eigenvalues[6:], rtol=1e-5)


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """A fork refined in this process: the command's arguments and the file."""
    out = str(tmp_path_factory.mktemp("alone") / "modes.h5")
    arguments = ["modes", "builtin:fork", "--resolution", "24", "--modes", "30"]
    arguments += ["--coarsen", "ddfem", "--refine-to", "0.03"]
    main([*arguments, "--out", out])
    return arguments, read_modes(out)


@pytest.mark.mpi
@pytest.mark.parametrize("ranks", TO_THREE)
def test_any_number_of_ranks_keeps_the_same_blocks_fine(ranks, alone, mpiexec, tmp_path):
    arguments, expected = alone
    out = tmp_path / "modes.h5"
    mpiexec(ranks, "solver", *arguments, "--out", out, check=True)
    found = read_modes(out)
    assert found.attributes["fine_blocks"] == expected.attributes["fine_blocks"] > 0
    np.testing.assert_array_equal(found.mesh.cells, expected.mesh.cells)
    np.testing.assert_allclose(found.eigenvalues[6:], expected.eigenvalues[6:], rtol=1e-5)


@pytest.mark.nightly
@pytest.mark.mpi
def test_memory_that_is_missing_for_the_estimate_ends_all_ranks(mpiexec, tmp_path):
    script = tmp_path / "little_memory.py"
    script.write_text(
        "import sys\n"
        "from solver.__main__ import main\n"
        "from solver.refinement import two_grid\n"
        "two_grid.available_memory = lambda: 1000\n"
        "sys.exit(main(sys.argv[1:]))\n"
    )
    out = tmp_path / "modes.h5"
    arguments = ["modes", "builtin:fork", "--resolution", "24", "--modes", "30", "--out", out]
    done = mpiexec(2, script, *arguments, "--coarsen", "ddfem")
    assert done.returncode == 2
    assert "--refine-to 0" in done.stderr and "Traceback" not in done.stderr
    assert not out.exists()


def test_the_summary_says_what_is_expected(tmp_path, capsys):
    out = str(tmp_path / "modes.h5")
    command = ["modes", "builtin:fork", "--resolution", "24", "--modes", "30", "--out", out]
    main([*command, "--coarsen", "ddfem"])
    assert "expected error against the voxels of frequencies 7 to 30: " in capsys.readouterr().out
    main([*command, "--coarsen", "ddfem", "--refine-to", "0", "--json"])
    assert "expected_frequency_error_rms" not in json.loads(capsys.readouterr().out)
    main([*command, "--coarsen", "average", "--refine-to", "0.1", "--json"])
    assert json.loads(capsys.readouterr().out)["expected_frequency_error_rms"] <= 0.1


@pytest.mark.parametrize(
    ("coarsen", "given", "tolerance"),
    [
        ("none", None, None),
        ("ddfem", None, ALLOWED_ERROR),
        ("average", None, None),
        ("average", 0.2, 0.2),
        ("ddfem", 0.0, None),
    ],
)
def test_what_is_allowed_if_nothing_is_said(coarsen, given, tolerance):
    assert RefinementOptions(given).tolerance(coarsen) == tolerance


def test_a_fine_mesh_is_not_refined():
    with pytest.raises(UserError, match="--coarsen ddfem"):
        RefinementOptions(0.05).tolerance("none")


@pytest.mark.parametrize("wrong", ["-0.1", "nan", "much", "11"])
def test_bad_errors_are_refused(wrong, tmp_path, capsys):
    out = tmp_path / "modes.h5"
    command = ["modes", "builtin:fork", "--resolution", "24", "--coarsen", "ddfem"]
    assert main([*command, "--refine-to", wrong, "--out", str(out)]) == 2
    assert "--refine-to" in capsys.readouterr().err
    assert not out.exists()
