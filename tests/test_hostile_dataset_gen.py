"""`python -m dataset_gen` meets hostile command lines and files; see `tests.hostile`."""

import pytest

from tests.hostile.dataset_cases import TABLE
from tests.hostile.fixtures import parameters


@pytest.mark.parametrize("case", parameters(TABLE))
def test_dataset_gen(case, tried):
    tried(case)
