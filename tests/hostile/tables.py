"""All tables by the name of their room."""

from tests.hostile import (
    carillon_cases,
    configuration_cases,
    dataset_cases,
    forests_cases,
    solver_cases,
    sound_cases,
    studio_cases,
    workflow_cases,
)

TABLES = {
    "dataset_gen": dataset_cases.TABLE,
    "forests": forests_cases.TABLE,
    "solver": solver_cases.TABLE,
    "sound": sound_cases.TABLE,
    "studio": studio_cases.TABLE,
    "workflow": workflow_cases.TABLE,
    "configuration": configuration_cases.TABLE,
    "carillon": carillon_cases.TABLE,
}
