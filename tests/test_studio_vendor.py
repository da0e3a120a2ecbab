"""The libraries of the studio's page are those that are listed, whole and with their licences."""

import base64
import hashlib
import json
from pathlib import Path

import pytest

VENDOR = Path(__file__).resolve().parent.parent / "studio" / "page" / "vendor"
LIST = json.loads((VENDOR / "vendor.json").read_text())
FILES = {file["file"]: file["sha256"] for entry in LIST for file in entry["files"]}


@pytest.mark.parametrize("name", FILES)
def test_a_file_is_the_one_listed(name):
    assert hashlib.sha256((VENDOR / name).read_bytes()).hexdigest() == FILES[name]


def test_there_is_no_other_file():
    found = {str(path.relative_to(VENDOR)) for path in VENDOR.rglob("*") if path.is_file()}
    assert found == {*FILES, "vendor.json"}


@pytest.mark.parametrize("entry", LIST, ids=lambda entry: entry["package"])
def test_a_package_says_where_it_is_from_and_what_its_licence_is(entry):
    method, _, digest = entry["integrity"].partition("-")
    assert method == "sha512" and len(base64.b64decode(digest, validate=True)) == 64
    licences = [file["file"] for file in entry["files"] if file["from"] == "LICENSE"]
    assert len(licences) == 1
    assert entry["licence"] in (VENDOR / licences[0]).read_text()
