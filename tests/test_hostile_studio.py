"""`python -m studio` meets hostile command lines and files; see `tests.hostile`."""

import pytest

from tests.hostile.fixtures import parameters
from tests.hostile.studio_cases import TABLE


@pytest.mark.parametrize("case", parameters(TABLE))
def test_studio(case, tried):
    tried(case)
