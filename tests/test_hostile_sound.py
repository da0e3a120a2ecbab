"""`python -m sound` meets hostile command lines and files; see `tests.hostile`."""

import pytest

from tests.hostile.fixtures import parameters
from tests.hostile.sound_cases import TABLE


@pytest.mark.parametrize("case", parameters(TABLE))
def test_sound(case, tried):
    tried(case)
