"""`python -m forests` meets hostile command lines and files; see `tests.hostile`."""

import pytest

from tests.hostile.fixtures import parameters
from tests.hostile.forests_cases import TABLE


@pytest.mark.parametrize("case", parameters(TABLE))
def test_forests(case, tried):
    tried(case)
