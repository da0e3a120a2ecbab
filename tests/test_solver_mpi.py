"""The solver on several ranks: the same result, and no rank left waiting after an error."""

from pathlib import Path

import numpy as np
import pytest

from solver.files.modes_file import read_modes
from solver.verification.comparison import compare_files
from tests.patience import HANG_SECONDS
from tests.rank_counts import SEVERAL, TO_THREE

pytestmark = pytest.mark.mpi

PROGRAM = Path(__file__).with_name("distributed_checks.py")
SOLID = ("builtin:bar", "--resolution", "24", "--material", "smooth")
MODEL = (*SOLID, "--subdomains", "7")
MODES = ("--modes", "50")


@pytest.fixture(scope="module")
def truth(tmp_path_factory, run_cli) -> Path:
    path = tmp_path_factory.mktemp("truth") / "truth.h5"
    run_cli("solver", "modes", *MODEL, *MODES, "--method", "slepc", "--out", path, check=True)
    return path


@pytest.mark.parametrize("ranks", [*TO_THREE, 5])
def test_ranks_factorise_together(ranks, mpiexec):
    names = [
        "all_ranks_factorise",
        "all_ranks_factorise_through_cells_of_several_sizes",
        "a_rank_that_fails_to_factorise_ends_all",
        "a_warm_start_takes_the_inverse_of_the_material_before",
    ]
    mpiexec(ranks, PROGRAM, ",".join(names), check=True)


@pytest.mark.parametrize("ranks", TO_THREE)
def test_painted_parts_give_the_bits_of_a_whole_synthesis(ranks, mpiexec):
    mpiexec(ranks, PROGRAM, "painted_parts_give_the_bits_of_a_whole_synthesis", check=True)


@pytest.mark.parametrize("ranks", [*TO_THREE, pytest.param(5, marks=pytest.mark.nightly)])
def test_a_synthesis_is_corrected_on_rows_cut_by_planes(ranks, mpiexec):
    names = [
        "corrections_of_a_synthesis_have_rows_cut_by_planes",
        "corrections_of_a_synthesis_do_not_depend_on_ranks",
        "a_synthesis_follows_materials_that_are_corrected_by_planes",
    ]
    mpiexec(ranks, PROGRAM, ",".join(names), check=True)


@pytest.mark.parametrize("ranks", TO_THREE)
def test_ranks_of_several_machines_solve_count_and_prove_as_those_of_one(ranks, mpiexec):
    names = [
        "mumps_solves_and_counts_what_the_own_factorisation_does",
        "modes_of_several_machines_are_those_of_one",
    ]
    mpiexec(ranks, PROGRAM, ",".join(names), check=True)


@pytest.mark.parametrize(
    ("ranks", "linear_solver"),
    [
        (3, "auto"),
        *(
            pytest.param(ranks, linear_solver, marks=pytest.mark.nightly)
            for ranks in (1, 2, 3, 7)
            for linear_solver in ("auto", "mumps")
            if (ranks, linear_solver) != (3, "auto")
        ),
    ],
)
def test_corrected_modes_on_any_number_of_ranks(ranks, linear_solver, truth, tmp_path, mpiexec):
    out = tmp_path / "modes.h5"
    options = ("--tol", "1e-11", "--linear-solver", linear_solver, "--out", out)
    mpiexec(ranks, "solver", "modes", *MODEL, *MODES, *options, check=True)
    comparison = compare_files(out, truth)
    assert comparison.eigenvalue_relative_error["max"] < 1e-10
    assert comparison.subspace_angle_max < 1e-4
    assert read_modes(out).attributes["ranks"] == ranks


@pytest.mark.parametrize("method", ["auto", "hcms"])
@pytest.mark.parametrize("ranks", [*TO_THREE, pytest.param(4, marks=pytest.mark.nightly)])
def test_a_tight_tolerance_is_met_on_1_to_4_ranks(ranks, method, truth, tmp_path, mpiexec):
    out = tmp_path / "modes.h5"
    options = ("--method", method, "--tol", "1e-11", "--no-estimate", "--out", out)
    mpiexec(ranks, "solver", "modes", *SOLID, *MODES, *options, check=True)
    assert read_modes(out).attributes["method"] == {"auto": "lanczos"}.get(method, method)
    assert compare_files(out, truth).eigenvalue_relative_error["max"] < 1e-9


@pytest.mark.nightly
def test_synthesis_is_the_same_on_1_2_and_3_ranks(tmp_path, mpiexec):
    values = []
    for ranks in (1, 2, 3):
        path = tmp_path / f"{ranks}.npz"
        mpiexec(ranks, PROGRAM, "synthesis_with_every_interface", path, check=True)
        values.append(dict(np.load(path)))
    assert sorted(values[0]) == ["fixed", "free", "overlapping"]
    for interface, alone in values[0].items():
        for other in values[1:]:
            # Local modes come from an iterative solver, converged to 1e-5 in the residual.
            assert np.abs(other[interface] - alone).max() < 1e-8 * alone[-1]


@pytest.mark.nightly
@pytest.mark.parametrize("ranks", SEVERAL)
def test_ground_truth_in_parallel(ranks, truth, tmp_path, mpiexec):
    out = tmp_path / "modes.h5"
    options = ("--method", "slepc", "--out", out)
    mpiexec(ranks, "solver", "modes", *MODEL, *MODES, *options, check=True)
    assert compare_files(out, truth).eigenvalue_relative_error["max"] < 1e-9
    attributes = read_modes(out).attributes
    assert attributes["inertia_count"] == attributes["inertia_expected"]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("builtin:bar", "--resolution", "20", "--subdomains", "2"), "3 ranks for 2 subdomains"),
        *(
            pytest.param(*each, marks=pytest.mark.nightly)
            for each in [
                (("missing.obj", "--resolution", "20"), "missing.obj"),
                (("builtin:bar", "--resolution", "20", "--material", "absent.npy"), "absent.npy"),
                (("builtin:bar", "--resolution", "6", "--modes", "5000"), "modes asked for"),
            ]
        ),
    ],
)
def test_bad_input_ends_all_ranks_with_one_sentence(arguments, sentence, tmp_path, mpiexec):
    done = mpiexec(3, "solver", "modes", *arguments, "--out", tmp_path / "modes.h5")
    assert done.returncode == 2
    lines = [line for line in done.stderr.splitlines() if line.startswith("solver modes:")]
    assert len(lines) == 1
    assert sentence in lines[0]
    assert list(tmp_path.iterdir()) == []


def test_failure_of_one_rank_ends_the_others(tmp_path, mpiexec):
    program = tmp_path / "one_fails.py"
    program.write_text(
        "import sys\n"
        "from mpi4py import MPI\n"
        "from solver.linear import multifrontal\n"
        "from solver.__main__ import main\n"
        "if MPI.COMM_WORLD.rank == 1:\n"
        "    multifrontal.available_memory = lambda: 0\n"
        f"sys.exit(main(['modes', *{MODEL!r}, '--modes', '30', '--out', 'x.h5']))\n"
    )
    done = mpiexec(3, program, timeout=HANG_SECONDS, cwd=tmp_path)
    assert done.returncode != 0
    assert "solver modes: the sparse factorisation of" in done.stderr
    assert not (tmp_path / "x.h5").exists()


def test_failure_that_only_one_rank_knows_of_ends_the_others(tmp_path, mpiexec):
    program = tmp_path / "one_fails.py"
    program.write_text(
        "import sys\n"
        "from mpi4py import MPI\n"
        "from carillon.errors import LocalConvergenceError\n"
        "from solver.hcms import local\n"
        "from solver.__main__ import main\n"
        "def fail(*_):\n"
        "    raise LocalConvergenceError('the modes of a subdomain did not converge')\n"
        "if MPI.COMM_WORLD.rank == 1:\n"
        "    local.lowest_modes = fail\n"
        f"options = [*{MODEL!r}, '--method', 'hcms', '--modes', '30', '--out', 'x.h5']\n"
        "sys.exit(main(['modes', *options]))\n"
    )
    done = mpiexec(3, program, timeout=HANG_SECONDS, cwd=tmp_path)
    assert done.returncode != 0
    assert "solver modes: the modes of a subdomain did not converge" in done.stderr
    assert not (tmp_path / "x.h5").exists()
