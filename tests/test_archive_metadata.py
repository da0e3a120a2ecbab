"""What archives read about the project says what CITATION.cff and pyproject.toml say."""

import json
import runpy

import pytest
import yaml

import carillon
from tests.programs import CHECKOUT

MADE = runpy.run_path(str(CHECKOUT / ".ci" / "archive_metadata.py"))
PERSON = {
    "family-names": "Lovelace",
    "given-names": "Ada",
    "orcid": "https://orcid.org/0000-0000-0000-0001",
}


@pytest.fixture
def citation() -> dict:
    return yaml.safe_load((CHECKOUT / "CITATION.cff").read_text())


@pytest.mark.parametrize("name", ["codemeta.json", ".zenodo.json"])
def test_the_files_are_those_that_their_program_writes(name):
    assert (CHECKOUT / name).read_text() == MADE["texts"]()[name], "python .ci/archive_metadata.py"


def test_codemeta_names_version_licence_and_requirements(citation):
    found = json.loads((CHECKOUT / "codemeta.json").read_text())
    assert found["version"] == carillon.__version__ == citation["version"]
    assert found["license"].endswith(f"/{citation['license']}")
    named = {each["name"] for each in found["softwareRequirements"]}
    assert {"numpy", "scipy", "pydantic"} <= named
    assert {"soundfile", "starlette", "mujoco-core"} <= named, "of sounds, the studio and scenes"
    assert "mpi4py" not in named, "of an extra"


def test_zenodo_gets_what_a_deposit_of_software_must_have(citation):
    found = json.loads((CHECKOUT / ".zenodo.json").read_text())
    assert found["upload_type"] == "software" and found["access_right"] == "open"
    assert found["title"] == citation["title"] and found["description"] == citation["abstract"]
    assert all(each["name"] for each in found["creators"])


def test_people_among_the_authors_keep_their_identifiers(citation):
    citation["authors"] = [PERSON]
    (creator,) = MADE["zenodo"](citation)["creators"]
    assert creator == {"name": "Lovelace, Ada", "orcid": "0000-0000-0000-0001"}
    project = {"requires-python": ">=3.11"}
    (author,) = MADE["codemeta"](citation, project, [])["author"]
    assert author["@id"] == PERSON["orcid"] and author["familyName"] == "Lovelace"
