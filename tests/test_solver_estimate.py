"""Expected errors of coarse models, and models that are refined until they are small."""

import json

import numpy as np
import pytest
from mpi4py import MPI
from scipy.stats import spearmanr

from carillon.errors import UserError
from carillon.fem.geometry import blocks_from_mesh
from carillon.fem.materials import young_modulus
from carillon.fem.model import RIGID_MODES, fine_model
from solver.__main__ import main
from solver.analysis.coarse_start import prolonged
from solver.analysis.options import SolverOptions
from solver.analysis.problem import ProblemOptions, build_problem
from solver.coarsening.choice import make_coarsening
from solver.files.modes_file import FINE_TAKEN, read_modes
from solver.refinement import coarse_or_fine, weighing
from solver.refinement.coarse_or_fine import solve_coarsened
from solver.refinement.errors import ALLOWED_ERROR, ExpectedErrors, RefinementOptions
from solver.refinement.estimate import element_energies, estimate_errors, fine_energies, mean_shares
from solver.refinement.inverse_iteration import InverseIteration
from solver.refinement.model_solver import SolveByOptions
from solver.refinement.refined_model import RefinedModel
from solver.refinement.weighing import analysis_work, is_followed, variation
from tests import solids
from tests.rank_counts import SEVERAL, TO_THREE

COMM = MPI.COMM_SELF


def solved(model, modes=60):
    """Modes of a model, by SLEPc."""
    return solids.analysed(model, method="slepc", modes=modes)


def whole(modes):
    """Modes (n_dofs, k) in mesh order."""
    return modes.system.gather(modes.vectors)


@pytest.fixture(scope="module", params=["fork:uniform", "dumbbell:noise"])
def solid(request):
    """Fine model, its exact eigenvalues, coarse blocks, coarse model and its modes."""
    name, material = request.param.split(":")
    problem = build_problem(ProblemOptions(f"builtin:{name}", 24, material))
    refined = RefinedModel(problem.model, make_coarsening("ddfem"))
    exact = solved(problem.model).values
    return problem.model, exact, refined.blocks, refined.model, solved(refined.model, 72)


def estimated(fine, blocks, modes):
    return estimate_errors(InverseIteration(fine, COMM), blocks, modes)


def test_values_come_from_above_and_near(solid):
    fine, exact, blocks, _, modes = solid
    found = InverseIteration(fine, COMM)
    elastic = np.ascontiguousarray(whole(modes)[:, RIGID_MODES:])
    lowest = found.lowest(modes.values[RIGID_MODES:60], prolonged(blocks, elastic), 66)
    count = 54
    assert (lowest.values[:count] >= exact[RIGID_MODES:] * (1.0 - 1e-9)).all()
    assert np.median(lowest.values[:count] / exact[RIGID_MODES:] - 1.0) < 0.01
    rated = np.ascontiguousarray(lowest.vectors[:, :count])
    gram = rated.T @ found.system.times_mass(rated)
    assert np.abs(gram - np.eye(count)).max() < 1e-8


def test_expected_errors_are_near_the_true_ones(solid):
    fine, exact, blocks, coarse, modes = solid
    estimate = estimated(fine, blocks, modes)
    true = np.sqrt(modes.values[RIGID_MODES:60] / exact[RIGID_MODES:]) - 1.0
    errors = estimate.errors.errors
    assert errors.shape == true.shape
    rms = np.sqrt(np.mean(true**2))
    assert abs(estimate.errors.rms - rms) < 0.2 * rms
    assert spearmanr(errors, true)[0] > 0.9
    vectors = np.ascontiguousarray(estimate.fine.vectors[:, :54])
    shares = mean_shares(blocks, coarse, fine, estimate.fine.values[:54], vectors)
    assert shares.shape == (blocks.coarse.n_cells,) and (shares >= 0.0).all()


def test_modes_that_a_coarse_model_lacks_are_counted():
    problem = build_problem(ProblemOptions("builtin:fork", 24))
    modes = solved(problem.model, 60)
    solid = InverseIteration(problem.model, COMM)
    solid.lowest(modes.values[RIGID_MODES:], [whole(modes)[:, RIGID_MODES:]], 54)
    assert solid.missed(modes.values[RIGID_MODES:]) == 0
    assert solid.missed(modes.values[RIGID_MODES + 10 :]) == 10


def test_nothing_is_missed_where_all_is_fine():
    problem = build_problem(ProblemOptions("builtin:fork", 24))
    refined = RefinedModel(problem.model, make_coarsening("ddfem"))
    refined.refine_all()
    blocks, coarse = refined.blocks, refined.model
    estimate = estimated(problem.model, blocks, solved(coarse, 40))
    assert np.abs(estimate.errors.errors).max() < 1e-6 and estimate.fine.missed == 0
    values = estimate.fine.values[:34]
    vectors = np.ascontiguousarray(estimate.fine.vectors[:, :34])
    assert mean_shares(blocks, coarse, problem.model, values, vectors).max() == 0.0


def test_energies_of_elements_sum_to_those_of_modes():
    problem = build_problem(ProblemOptions("builtin:bar", 12, "noise"))
    found = solved(problem.model, 20)
    values, modes = found.values, whole(found)
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
    assert ExpectedErrors(np.array([0.1, -0.1])).excess(0.1) == pytest.approx(1.0)
    spiked = ExpectedErrors(np.array([0.0] * 99 + [-0.6]))
    assert spiked.excess(0.1) == pytest.approx(2.0)
    assert (spiked.worst, spiked.worst_mode) == (-0.6, 106)


def test_frequencies_are_as_near_as_was_asked_for(tmp_path):
    out, truth = str(tmp_path / "modes.h5"), str(tmp_path / "truth.h5")
    solid = ["builtin:eared-head", "--resolution", "16", "--modes", "60", "--method", "slepc"]
    main(["modes", *solid, "--out", truth])
    exact, fine_blocks = read_modes(truth), []
    for tolerance in (0.05, 0.02):
        main(["modes", *solid, "--coarsen", "ddfem", "--refine-to", str(tolerance), "--out", out])
        file = read_modes(out)
        errors = np.sqrt(file.eigenvalues[6:] / exact.eigenvalues[6:]) - 1.0
        assert np.sqrt(np.mean(errors**2)) < tolerance
        assert np.abs(errors).max() < 3.0 * tolerance
        assert file.attributes["expected_frequency_error_rms"] <= tolerance
        fine_blocks.append(file.attributes["fine_blocks"])
        assert (FINE_TAKEN in file.attributes) == (file.mesh.n_nodes == exact.mesh.n_nodes)
    assert fine_blocks[0] <= fine_blocks[1]


SLEPC = ("--method", "slepc", "--modes", "40")
"""SLEPc takes so long that coarse models pay on small solids."""


HEAD = ("builtin:eared-head", "--resolution", "16", "--modes", "40", "--coarsen", "ddfem")
"""A solid whose coarse model is 6 % off."""


def script_with(path, clearly, refined):
    """The command with other shares of the fine analysis's work that are worth it."""
    path.write_text(
        "import sys\n"
        "from solver.__main__ import main\n"
        "from solver.refinement import weighing\n"
        f"weighing.CLEARLY, weighing.REFINED = {clearly}, {refined}\n"
        "sys.exit(main(sys.argv[1:]))\n"
    )
    return path


@pytest.fixture(scope="module")
def head(tmp_path_factory):
    """Modes file of the head with some blocks fine, whatever that costs."""
    out = str(tmp_path_factory.mktemp("head") / "modes.h5")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(weighing, "CLEARLY", 10.0)
        patch.setattr(weighing, "REFINED", 10.0)
        main(["modes", *HEAD, "--out", out])
    return out


def test_a_refined_model_is_started_from(head, tmp_path):
    again = str(tmp_path / "again.h5")
    before = read_modes(head)
    assert before.attributes["refinement_steps"] > 0 and FINE_TAKEN not in before.attributes
    main(["modes", *HEAD, "--initial-modes", head, "--out", again])
    after = read_modes(again)
    assert after.attributes["refinement_steps"] == 0
    np.testing.assert_array_equal(before.mesh.cells, after.mesh.cells)
    np.testing.assert_allclose(before.eigenvalues[6:], after.eigenvalues[6:], rtol=1e-5)


def test_the_fine_solid_is_started_from(tmp_path):
    first, again = str(tmp_path / "first.h5"), str(tmp_path / "again.h5")
    solid = ["builtin:fork", "--resolution", "16", "--modes", "20", "--coarsen", "ddfem"]
    main(["modes", *solid, "--out", first])
    main(["modes", *solid, "--initial-modes", first, "--out", again])
    before, after = read_modes(first), read_modes(again)
    assert "few unknowns" in before.attributes[FINE_TAKEN]
    assert "to start from" in after.attributes[FINE_TAKEN]
    np.testing.assert_allclose(before.eigenvalues[6:], after.eigenvalues[6:], rtol=1e-5)


@pytest.mark.mpi
@pytest.mark.parametrize("ranks", SEVERAL)
def test_any_number_of_ranks_keeps_the_same_blocks_fine(ranks, head, mpiexec, tmp_path):
    script, out = script_with(tmp_path / "refined.py", 10.0, 10.0), tmp_path / "modes.h5"
    mpiexec(ranks, script, "modes", *HEAD, "--out", out, check=True)
    found, expected = read_modes(out), read_modes(head)
    assert found.attributes["fine_blocks"] == expected.attributes["fine_blocks"] > 0
    np.testing.assert_array_equal(found.mesh.cells, expected.mesh.cells)
    np.testing.assert_allclose(found.eigenvalues[6:], expected.eigenvalues[6:], rtol=1e-5)
    errors = [each.attributes["expected_frequency_error_rms"] for each in (found, expected)]
    assert errors[0] == pytest.approx(errors[1], rel=1e-5)


@pytest.mark.mpi
@pytest.mark.parametrize("ranks", TO_THREE)
def test_any_number_of_ranks_goes_on_to_the_fine_solid(ranks, mpiexec, tmp_path):
    script, out = script_with(tmp_path / "fine.py", 10.0, 0.0), tmp_path / "modes.h5"
    mpiexec(ranks, script, "modes", *HEAD, "--out", out, check=True)
    found = read_modes(out)
    assert "keeping blocks fine would save little" in found.attributes[FINE_TAKEN]
    assert found.attributes["ranks"] == ranks
    exact = solved(build_problem(ProblemOptions("builtin:eared-head", 16)).model, 40).values
    np.testing.assert_allclose(found.eigenvalues[6:], exact[6:], rtol=1e-6)


# Which one is taken


def taken(mesh, resolution, material, **options):
    """What is found for a solid, whose coarse model is weighed as for 250 modes unless told."""
    problem = build_problem(ProblemOptions(f"builtin:{mesh}", resolution, material))
    weighed = SolverOptions(**{"modes": 250, **options})
    solve = SolveByOptions(SolverOptions(modes=20), COMM)
    refined = RefinedModel(problem.model, make_coarsening("ddfem"))
    return problem, solve_coarsened(solve, refined, 0.05, weighed, COMM)


def test_a_material_that_no_coarse_element_follows_is_solved_fine_at_once():
    problem, found = taken("pitcher", 16, "random")
    assert found.reason.startswith("the material varies from voxel to voxel, by a factor of ")
    assert found.model is not None and found.model.mesh is problem.fine and not found.steps
    assert found.errors.rms == 0.0


def test_a_material_is_followed_in_blocks_of_its_own_and_in_thick_solids():
    for mesh, material, followed in (
        ("pitcher", "uniform", True),
        ("pitcher", "noise", True),
        ("pitcher", "random", False),
        ("box", "random", True),
    ):
        problem = build_problem(ProblemOptions(f"builtin:{mesh}", 16, material))
        assert is_followed(blocks_from_mesh(problem.fine), problem.young) == followed
    uniform = build_problem(ProblemOptions("builtin:bar", 8))
    assert variation(blocks_from_mesh(uniform.fine), uniform.young) == 1.0


@pytest.mark.parametrize("is_rated", [True, False])
def test_the_coarse_model_stands_where_the_fine_solid_cannot_be_solved(
    is_rated, monkeypatch, capfd
):
    problem = build_problem(ProblemOptions("builtin:bell", 20, "smooth"))
    refined, options = (
        RefinedModel(problem.model, make_coarsening("ddfem")),
        SolverOptions(modes=20),
    )
    alone = SolveByOptions(options, COMM)

    def solve(model, *, start=None):
        if model.n_dofs == problem.model.n_dofs:
            raise UserError("no factorisation fits into the memory")
        return alone(model, start=start)

    def unrated(*_):
        raise UserError("there is no memory for that")

    if not is_rated:
        monkeypatch.setattr(coarse_or_fine, "estimate_errors", unrated)
    # So small a tolerance that no refined model is worth it.
    found = solve_coarsened(solve, refined, 1e-6, SolverOptions(modes=250), COMM)
    assert found.reason is None and (found.errors is not None) == is_rated
    assert found.model.n_dofs < problem.model.n_dofs and len(found.modes.values) == 20
    told = capfd.readouterr().err
    assert "warning: the modes are those of the coarse model: no factorisation fits" in told


def test_few_modes_of_few_unknowns_are_found_on_the_fine_mesh_at_once():
    _, found = taken("bar", 16, "uniform", modes=20)
    assert "so few unknowns" in found.reason and not found.steps


def test_a_coarse_model_that_is_near_enough_is_kept():
    problem, found = taken("bell", 20, "smooth")
    assert found.reason is None and found.errors.excess(0.05) <= 1.0
    assert found.model.n_dofs < 0.4 * problem.model.n_dofs


def test_work_grows_with_unknowns_modes_and_slow_methods():
    sizes = np.geomspace(100, 1e6, 20).astype(int)
    spent = np.array([analysis_work(size, 60) for size in sizes])
    assert (np.diff(spent) > 0.0).all()
    assert analysis_work(10_000, 256) > analysis_work(10_000, 60)
    assert analysis_work(10_000, 60, "slepc") > analysis_work(10_000, 60, "hcms") > spent[0]


def test_the_summary_says_what_is_expected(tmp_path, capsys):
    out = str(tmp_path / "modes.h5")
    command = ["modes", "builtin:bell", "--resolution", "16", *SLEPC, "--out", out]
    main([*command, "--coarsen", "ddfem"])
    assert "expected error against the voxels of frequencies 7 to 40: " in capsys.readouterr().out
    main([*command, "--coarsen", "ddfem", "--refine-to", "0", "--json"])
    assert "expected_frequency_error_rms" not in json.loads(capsys.readouterr().out)
    main([*command, "--coarsen", "average", "--refine-to", "0.1", "--json"])
    assert json.loads(capsys.readouterr().out)["expected_frequency_error_rms"] <= 0.1


def test_the_summary_says_that_the_fine_solid_was_taken_and_files_can_be_compared(tmp_path, capsys):
    out, truth = str(tmp_path / "modes.h5"), str(tmp_path / "truth.h5")
    command = ["modes", "builtin:pitcher", "--resolution", "16", "--material", "random"]
    command += ["--modes", "30"]
    main([*command, "--coarsen", "ddfem", "--out", out])
    printed = capsys.readouterr().out
    assert "the fine solid was solved: the material varies from voxel to voxel" in printed
    assert "expected error" not in printed
    main([*command, "--no-estimate", "--out", truth])
    file = read_modes(out)
    assert file.attributes["coarsen"] == "ddfem"
    assert file.attributes["n_dofs"] == file.attributes["fine_n_dofs"]
    assert file.attributes["expected_frequency_error_worst"] == 0.0
    capsys.readouterr()
    main(["compare", out, truth, "--json"])
    (compared,) = json.loads(capsys.readouterr().out)["comparisons"].values()
    assert compared["frequency_rms_relative_error"] < 1e-6 and "matched" not in compared


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
