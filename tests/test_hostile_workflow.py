"""`python -m workflow`, `python -m carillon` and configurations; see `tests.hostile`."""

import pytest

from tests.hostile import carillon_cases, configuration_cases, workflow_cases
from tests.hostile.fixtures import parameters


@pytest.mark.parametrize("case", parameters(workflow_cases.TABLE))
def test_workflow(case, tried):
    tried(case)


@pytest.mark.parametrize("case", parameters(configuration_cases.TABLE))
def test_configuration(case, tried):
    tried(case)


@pytest.mark.parametrize("case", parameters(carillon_cases.TABLE))
def test_carillon(case, tried):
    tried(case)
