"""What `auto` takes for a large solid: a factorisation, or gradients from coarse modes."""

import json
from dataclasses import replace

import numpy as np
import pytest

from carillon.errors import ConvergenceError
from solver.__main__ import main
from solver.analysis import corrected, modal_solver
from solver.analysis.coarse_start import coarse_start
from solver.analysis.faster_method import FEWEST_UNKNOWNS, gradients_are_faster
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.options import SolverOptions
from solver.commands import modes as command
from tests import solids


class Tree:
    """Operations of a compact solid's factorisation and solves, see `RankTree.operations`."""

    def __init__(self, n_dofs: int) -> None:
        self._n_dofs = float(n_dofs)

    def operations(self) -> tuple[float, float]:
        return 17.0 * self._n_dofs**2, 8.2 * self._n_dofs ** (4.0 / 3.0) * 10.0


def is_faster(n_dofs: int, from_coarse: bool = True, **options: float) -> bool:
    return gradients_are_faster(Tree(n_dofs), n_dofs, SolverOptions(**options), from_coarse)


def test_more_unknowns_and_fewer_modes_speak_for_conjugate_gradients():
    for modes in (64, 256):
        sizes = [is_faster(n_dofs, modes=modes) for n_dofs in (30_000, 10**5, 10**6, 10**7, 10**8)]
        assert sizes == sorted(sizes) and sizes[-1] and not sizes[0]
    modes = [is_faster(10**6, modes=modes) for modes in (20, 64, 256, 1000, 5000)]
    assert modes == sorted(modes, reverse=True) and modes[0] and not modes[-1]
    tolerances = [is_faster(150_000, modes=64, tolerance=10.0**-d) for d in range(2, 13)]
    assert tolerances == sorted(tolerances, reverse=True)
    size = {"n_dofs": 250_000, "modes": 64, "tolerance": 1e-6}
    assert is_faster(**size) and not is_faster(from_coarse=False, **size)
    assert not is_faster(FEWEST_UNKNOWNS - 1, modes=10, tolerance=1e-2)


@pytest.fixture
def always(monkeypatch):
    """Conjugate gradients are always reckoned to be faster."""
    monkeypatch.setattr(modal_solver, "gradients_are_faster", lambda *_: True)
    monkeypatch.setattr(command, "FEWEST_UNKNOWNS", 0)


def test_only_a_single_solve_left_to_choice_takes_them(always):
    model, options = solids.random_box(9, 6, 5), SolverOptions(modes=20)
    assert ModalSolver(model, options, once=True).options.method == "lobpcg"
    assert ModalSolver(model, options).options.method == "lanczos"
    for given in ({"method": "lanczos"}, {"linear_solver": "multifrontal"}):
        solver = ModalSolver(model, replace(options, **given), once=True)
        assert solver.options.method == "lanczos"


def test_a_bad_choice_ends_in_a_factorisation(always, monkeypatch, capsys):
    model, options = solids.random_box(9, 6, 5), SolverOptions(modes=20)

    def stagnate(*_: object) -> None:
        raise ConvergenceError("conjugate gradients stagnate")

    monkeypatch.setattr(corrected, "correct", wrapped(corrected.correct, stagnate))
    solver = ModalSolver(model, options, once=True)
    modes = solver.solve()
    assert modes.evidence["method"] == solver.options.method == "lanczos"
    assert modes.evidence["linear_solver"] == "multifrontal"
    exact = solids.dense_eigenvalues(model)[6:20]
    assert np.abs(modes.values[6:] / exact - 1.0).max() < 1e-6
    assert "conjugate gradients stagnate; a factorisation is made" in capsys.readouterr().err


def wrapped(correct, stagnate):
    """`correct`, which fails where it has no factorisation."""

    def instead(system, start, requested, linear, *others, **options):
        if linear.method == "amg-cg":
            stagnate()
        return correct(system, start, requested, linear, *others, **options)

    return instead


def test_the_command_starts_from_coarse_modes_where_it_is_left_to_choose(
    always, monkeypatch, capsys, tmp_path
):
    starts = []

    def counted(*arguments, **options):
        starts.append(arguments)
        return coarse_start(*arguments, **options)

    monkeypatch.setattr(command, "coarse_start", counted)
    solid = ["modes", "builtin:bell", "--resolution", "16", "--modes", "20", "--no-estimate"]
    spectra = []
    for method, count in ((["--method", "lanczos"], 0), ([], 1), (["--method", "lobpcg"], 1)):
        out = str(tmp_path / "modes.h5")
        assert main([*solid, *method, "--json", "--out", out]) == 0
        spectra.append(json.loads(capsys.readouterr().out)["frequencies_hz"][6:])
        assert len(starts) == count
    np.testing.assert_allclose(spectra[1:], [spectra[0]] * 2, rtol=1e-6)
