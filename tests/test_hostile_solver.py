"""`python -m solver` meets hostile command lines and files; see `tests.hostile`."""

import pytest

from tests.hostile.fixtures import parameters
from tests.hostile.solver_cases import TABLE


@pytest.mark.parametrize("case", parameters(TABLE))
def test_solver(case, tried):
    tried(case)
