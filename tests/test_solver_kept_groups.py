"""Component modes of a solid of which one part is painted: the rest is not made again."""

import numpy as np
import pytest
from mpi4py import MPI

from solver.distribution.local_mesh import distribute, scatter_moduli
from solver.hcms import synthesis
from solver.hcms.kept_groups import KeptGroups
from solver.hcms.local import Subdomain
from solver.hcms.synthesis import synthesize
from tests import solids

PARTS = 6


@pytest.fixture
def model():
    return solids.random_box(12, 6, 5)


def moduli(model, painted):
    """Moduli (m, 8) of which some near one end are `painted` times as large."""
    young = np.array(model.young)
    young[:20] *= painted
    return young


def synthesized(model, kept, painted):
    comm = MPI.COMM_SELF
    mesh = scatter_moduli(distribute(model, PARTS, comm=comm), moduli(model, painted), comm)
    return synthesize(mesh, 40, comm=comm, kept=kept)


def test_only_what_was_painted_is_solved_again(model, monkeypatch):
    solved = []
    modes = Subdomain.modes

    def counted(self, *arguments):
        solved.append(self)
        return modes(self, *arguments)

    monkeypatch.setattr(Subdomain, "modes", counted)
    kept, work = KeptGroups(), []
    for painted in (1.0, 1.0, 2.0, 3.0):
        solved.clear()
        result = synthesized(model, kept, painted)
        cold = synthesized(model, None, painted)
        assert (result.values == cold.values).all() and (result.vectors == cold.vectors).all()
        work.append(len(solved) - PARTS)
    assert work[:2] == [PARTS, 0]
    assert 0 < work[2] == work[3] < PARTS


def test_nothing_is_kept_of_a_synthesis_that_failed(model, monkeypatch):
    kept = KeptGroups()
    synthesized(model, kept, 1.0)
    with monkeypatch.context() as patch:
        patch.setattr(synthesis, "boundary_of", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            synthesized(model, kept, 2.0)
    result, cold = synthesized(model, kept, 2.0), synthesized(model, None, 2.0)
    assert (result.values == cold.values).all() and (result.vectors == cold.vectors).all()
