"""What is computed besides the modes never takes them along when it fails."""

import pytest
from mpi4py import MPI

from carillon.errors import ConvergenceError, UserError
from solver.__main__ import main
from solver.accuracy.voxels import Reference
from solver.distribution.collective import optional
from solver.files.modes_file import read_modes

MODES = ["modes", "builtin:bar", "--resolution", "8", "--modes", "10"]
FAILURES = [UserError("it is lost"), ConvergenceError("it wanders"), ValueError("no such cell")]


def fail(error):
    """A function that raises the error, whatever it is given."""

    def failing(*_, **__):
        raise error

    return failing


@pytest.mark.parametrize("error", FAILURES, ids=lambda error: type(error).__name__)
@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("solver.accuracy.voxels.Reference.of_voxels", []),
        ("solver.accuracy.voxels.Reference.errors", []),
        ("solver.accuracy.divide.estimate_cell_errors", ["--discretisation", "finite-cell"]),
    ],
)
def test_an_estimate_that_fails_leaves_the_modes_and_a_warning(
    place, words, error, tmp_path, monkeypatch, capfd
):
    monkeypatch.setattr(place, fail(error))
    out = tmp_path / "modes.h5"
    assert main([*MODES, *words, "--out", str(out)]) == 0
    assert len(read_modes(out).eigenvalues) == 10
    said = capfd.readouterr().err
    assert said.count("warning: how far frequencies are") == 1 and str(error) in said


def test_finite_cells_that_cannot_be_solved_leave_the_voxels_modes(tmp_path, monkeypatch, capfd):
    of_voxels = Reference.of_voxels

    def poor(described, problem):
        reference = of_voxels(described, problem)
        reference.model.young[:] = float("nan")
        return reference

    monkeypatch.setattr(Reference, "of_voxels", poor)
    out = tmp_path / "modes.h5"
    assert main([*MODES, "--out", str(out)]) == 0
    assert len(read_modes(out).eigenvalues) == 10
    assert "warning: how far frequencies are from the solid's" in capfd.readouterr().err


def test_a_refined_model_that_cannot_be_solved_leaves_the_one_before(tmp_path, monkeypatch, capfd):
    from solver.analysis.modal_solver import ModalSolver

    solve, calls = ModalSolver.solve, []

    def once(self, *arguments, **keywords):
        calls.append(1)
        if len(calls) > 1:
            raise ConvergenceError("it wanders")
        return solve(self, *arguments, **keywords)

    monkeypatch.setattr(ModalSolver, "solve", once)
    out = tmp_path / "modes.h5"
    words = ["--discretisation", "finite-cell", "--refine-to", "1e-3", "--out", str(out)]
    assert main(["modes", "builtin:plate", "--resolution", "8", "--modes", "10", *words]) == 0
    assert len(calls) == 2 and len(read_modes(out).eigenvalues) == 10
    assert "warning: the model is refined no further: it wanders" in capfd.readouterr().err


def test_an_accuracy_that_cannot_be_told_is_an_error(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(Reference, "of_voxels", fail(UserError("it is lost")))
    assert main([*MODES, "--accuracy", "0.1", "--out", str(tmp_path / "modes.h5")]) == 2
    assert "--accuracy needs a distance from the solid" in capfd.readouterr().err


def test_an_error_of_one_rank_alone_is_not_caught():
    """The others would wait for it."""

    class Two:
        size, rank = 2, 0

    with pytest.raises(ValueError, match="here"):
        optional(Two(), "nothing is lost", fail(ValueError("here")))
    assert optional(MPI.COMM_SELF, "nothing is lost", fail(ValueError("here"))) is None
