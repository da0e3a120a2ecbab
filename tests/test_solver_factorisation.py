"""A factorisation succeeds, or is known not to have."""

import numpy as np
import pytest
import scipy.sparse as sp

from carillon.errors import ConvergenceError
from carillon.processes.petsc import PETSc
from solver.linear import factorisation
from solver.linear.factorisation import factorised

pytestmark = pytest.mark.skipif(
    not PETSc.Sys.hasExternalPackage("mumps"), reason="this PETSc has no MUMPS"
)
FOR_INERTIA = {13: 1, 24: 1}


@pytest.fixture
def saddle():
    """A matrix whose diagonal is of no use as pivots, as scipy's and as PETSc's."""
    rng = np.random.default_rng(0)
    block = sp.random(400, 400, density=0.015, random_state=rng, data_rvs=rng.standard_normal)
    matrix = sp.bmat([[None, block], [block.T, None]]) + 1e-6 * sp.eye(800)
    matrix = matrix.tocsr()
    matrix.sort_indices()
    ours = (matrix.indptr, matrix.indices, matrix.data)
    theirs = PETSc.Mat().createAIJ(matrix.shape, csr=ours, comm=PETSc.COMM_SELF)
    theirs.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    yield matrix, theirs
    theirs.destroy()


def test_a_factor_that_outgrows_its_guess_gets_more_room(saddle, monkeypatch):
    matrix, petsc = saddle
    factor = factorised(petsc, FOR_INERTIA)
    negative, *_ = factor.getFactorMatrix().getInertia()
    factor.destroy()
    assert negative == np.count_nonzero(np.linalg.eigvalsh(matrix.toarray()) < 0.0)
    monkeypatch.setattr(factorisation, "ROOM", factorisation.ROOM[:1])
    with pytest.raises(ConvergenceError, match=r"of 800 unknowns failed \(MUMPS: INFOG\(1\) = -9"):
        factorised(petsc, FOR_INERTIA)
