"""What a design file gives back, and what it refuses."""

from dataclasses import asdict, replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from carillon.errors import UserError
from sound.project.design import Design
from sound.project.design_file import read_design, write_design
from tests.edited_files import edited, put
from tests.small_design import small_design


@pytest.fixture
def path(tmp_path) -> Path:
    write_design(tmp_path / "design.h5", small_design())
    return tmp_path / "design.h5"


def test_a_design_comes_back(path):
    read = asdict(read_design(path))
    assert read.pop("provenance")["commit"]
    expected = asdict(small_design())
    del expected["provenance"]
    np.testing.assert_equal(read, expected)


def test_empty_residuals_and_history_come_back(tmp_path):
    design = small_design()
    targets = replace(design.targets, residuals=(np.zeros(0), np.zeros(0)))
    empty = replace(design, targets=targets, history=design.history[:0])
    write_design(tmp_path / "design.h5", empty)
    designed = read_design(tmp_path / "design.h5")
    assert [len(part) for part in designed.targets.residuals] == [0, 0]
    assert len(designed.history) == 0


def test_every_dataset_says_its_unit_and_what_it_is(path):
    unlabelled = []

    def look(name: str, item: h5py.Dataset | h5py.Group) -> None:
        if isinstance(item, h5py.Dataset) and not {"units", "long_name"} <= set(item.attrs):
            unlabelled.append(name)

    with h5py.File(path) as file:
        file.visititems(look)
    assert unlabelled == []


def test_frequencies_are_those_of_the_elastic_modes(path):
    design = read_design(path)
    assert len(design.frequencies) == design.elastic_modes.shape[1] == 8
    np.testing.assert_allclose((2 * np.pi * design.frequencies) ** 2, design.eigenvalues[6:])


def test_parts_that_do_not_fit_are_not_written(tmp_path):
    design = small_design()
    with pytest.raises(ValueError, match="modes of shape"):
        write_design(tmp_path / "design.h5", replace(design, modes=design.modes[:, 1:]))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (put("targets/dampings", lambda values: values[:3]), "holds dampings of shape"),
        (put("eigenvalues", lambda values: values[:13]), "holds eigenvalues of shape"),
        (put("surface/vertices", lambda values: values[:5]), "names the surface's vertex"),
        (lambda file: file.pop("targets/rates"), "incomplete"),
        (lambda file: file.attrs.modify("schema_version", 99), "schema 99"),
    ],
)
def test_a_file_whose_parts_do_not_fit_is_refused(path, change, complaint):
    with edited(path) as file:
        change(file)
    with pytest.raises(UserError, match=complaint):
        read_design(path)


def test_a_damaged_file_is_refused(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(UserError, match="damaged"):
        read_design(path)


def test_a_design_is_replaced_whole(path):
    other: Design = replace(small_design(), evidence={"stopped": "later"})
    write_design(path, other)
    assert read_design(path).evidence == {"stopped": "later"}


SETTINGS = {
    "[]": "settings",
    "5": "settings",
    "null": "settings",
    '"text"': "settings",
    '{"mesh": 5}': "mesh",
    '{"unit": "metre"}': "unit",
    '{"unit": 0}': "unit",
    '{"unit": NaN}': "unit",
    '{"unit": true}': "unit",
    '{"up": "north"}': "up",
    '{"up": []}': "up",
    '{"material": 5}': "material",
    '{"damping": []}': "damping",
    '{"damping": {"source": ["clips"]}}': "damping.source",
}
EVIDENCE = {"[]": "evidence", '{"cost": "low"}': "cost", '{"cost_start": []}': "cost_start"}


@pytest.mark.parametrize("name", ["settings", "evidence"])
def test_settings_and_evidence_of_another_kind_are_told(path, name):
    given = SETTINGS if name == "settings" else EVIDENCE
    for text, key in given.items():
        with edited(path) as file:
            file[name][()] = text
        with pytest.raises(UserError, match=rf"design.h5: holds .*{key} .*, expected .*; make"):
            read_design(path)
