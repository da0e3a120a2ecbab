"""What gives the same bits again, and what only agrees to a bound (docs/reproducibility.md)."""

from pathlib import Path

import numpy as np
import pytest

from tests.repeated_results import TOLERANCE

pytestmark = pytest.mark.nightly

HERE = Path(__file__).parent
RESIDUAL_TOLERANCE = 1e-9
"""Relative error of eigenvalues from SLEPc, whose residuals are below 1e-10."""
CIRCUMSTANCES = {
    "first": {"PYTHONHASHSEED": "0", "OMP_NUM_THREADS": "2"},
    "hashes": {"PYTHONHASHSEED": "12345", "OMP_NUM_THREADS": "2"},
    "threads": {"PYTHONHASHSEED": "1", "OMP_NUM_THREADS": "1"},
}


@pytest.fixture(scope="module")
def results(tmp_path_factory, start_cli):
    folder = tmp_path_factory.mktemp("results")
    found = {}
    for name, variables in CIRCUMSTANCES.items():
        path = folder / f"{name}.npz"
        start_cli("tests.repeated_results", path, folder, env=variables, check=True)
        found[name] = dict(np.load(path))
    return found


@pytest.mark.parametrize("kind", ["shard", "forests", "design", "modes"])
def test_same_bits_whatever_the_hash_seed(kind, results):
    equal(results["first"], results["hashes"], kind)


@pytest.mark.parametrize("kind", ["shard", "forests", "design"])
def test_same_bits_on_any_number_of_threads(kind, results):
    equal(results["first"], results["threads"], kind)


@pytest.mark.parametrize(
    ("method", "bound"),
    [("synthesis", 1e-8), ("corrected", 2 * TOLERANCE), ("slepc", RESIDUAL_TOLERANCE)],
)
def test_eigenvalues_agree_to_the_tolerance_on_any_number_of_threads(method, bound, results):
    one, two = (results[name][f"modes/{method}/values"][6:] for name in ("threads", "first"))
    assert np.abs(one / two - 1.0).max() < bound


def equal(one, other, kind):
    names = [name for name in one if name.startswith(f"{kind}/")]
    assert names
    for name in names:
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)


@pytest.mark.mpi
@pytest.mark.parametrize("ranks", [2, 3])
def test_repetitions_on_several_ranks(ranks, mpiexec):
    names = [
        "multigrid_is_the_same_bits_again",
        "repetitions_give_the_same_bits",
        "repetitions_with_mumps_agree_to_the_tolerance",
    ]
    mpiexec(ranks, HERE / "distributed_checks.py", ",".join(names), check=True)
