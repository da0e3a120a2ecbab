"""What a design file gives back, and what it refuses."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from carillon.errors import UserError
from sound.project.design import Design
from sound.project.design_file import read_design, write_design
from tests.edited_files import edited
from tests.small_design import small_design


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_design(tmp_path / "design.h5", small_design())
    return tmp_path / "design.h5"


def assert_same(actual: object, expected: object) -> None:
    if isinstance(expected, dict):
        assert actual.keys() == expected.keys()
        for key in expected:
            assert_same(actual[key], expected[key])
    elif isinstance(expected, (list, tuple)):
        assert len(actual) == len(expected)
        for a, b in zip(actual, expected):
            assert_same(a, b)
    else:
        np.testing.assert_array_equal(actual, expected)


def test_a_design_comes_back(path: Path) -> None:
    read = asdict(read_design(path))
    assert read.pop("provenance")["commit"]
    expected = asdict(small_design())
    del expected["provenance"]
    assert_same(read, expected)


def test_empty_residuals_and_history_come_back(tmp_path: Path) -> None:
    design = small_design()
    targets = replace(design.targets, residuals=(np.zeros(0), np.zeros(0)))
    empty = replace(design, targets=targets, history=design.history[:0])
    write_design(tmp_path / "design.h5", empty)
    designed = read_design(tmp_path / "design.h5")
    assert [len(part) for part in designed.targets.residuals] == [0, 0]
    assert len(designed.history) == 0


def test_every_dataset_says_its_unit_and_what_it_is(path: Path) -> None:
    unlabelled = []

    def look(name: str, item: h5py.Dataset | h5py.Group) -> None:
        if isinstance(item, h5py.Dataset) and not {"units", "long_name"} <= set(item.attrs):
            unlabelled.append(name)

    with h5py.File(path) as file:
        file.visititems(look)
    assert unlabelled == []


def test_frequencies_are_those_of_the_elastic_modes(path: Path) -> None:
    design = read_design(path)
    assert len(design.frequencies) == design.elastic_modes.shape[1] == 8
    np.testing.assert_allclose((2 * np.pi * design.frequencies) ** 2, design.eigenvalues[6:])


def test_parts_that_do_not_fit_are_not_written(tmp_path: Path) -> None:
    design = small_design()
    with pytest.raises(ValueError, match="modes of shape"):
        write_design(tmp_path / "design.h5", replace(design, modes=design.modes[:, 1:]))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "rows", "complaint"),
    [
        ("targets/dampings", 3, "holds dampings of shape"),
        ("eigenvalues", 13, "holds eigenvalues of shape"),
        ("surface/vertices", 5, "names the surface's vertex"),
    ],
)
def test_a_file_whose_parts_do_not_fit_is_refused(
    path: Path, name: str, rows: int, complaint: str
) -> None:
    with edited(path) as file:
        data = file[name][:rows]
        del file[name]
        file[name] = data
    with pytest.raises(UserError, match=complaint):
        read_design(path)


def test_a_file_that_lacks_a_part_is_refused(path: Path) -> None:
    with edited(path) as file:
        del file["targets/rates"]
    with pytest.raises(UserError, match="incomplete"):
        read_design(path)


def test_another_schema_is_refused(path: Path) -> None:
    with edited(path) as file:
        file.attrs["schema_version"] = 99
    with pytest.raises(UserError, match="schema 99"):
        read_design(path)


def test_a_damaged_file_is_refused(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(UserError, match="damaged"):
        read_design(path)


def test_a_design_is_replaced_whole(path: Path) -> None:
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
    '{"material": 5}': "material",
    '{"damping": []}': "damping",
    '{"damping": {"source": ["clips"]}}': "damping.source",
}
EVIDENCE = {"[]": "evidence", '{"cost": "low"}': "cost", '{"cost_start": []}': "cost_start"}


@pytest.mark.parametrize("name", ["settings", "evidence"])
def test_settings_and_evidence_of_another_kind_are_told(path: Path, name: str) -> None:
    given = SETTINGS if name == "settings" else EVIDENCE
    for text, key in given.items():
        with edited(path) as file:
            file[name][()] = text
        with pytest.raises(UserError, match=rf"design.h5: holds .*{key} .*, expected .*; make"):
            read_design(path)
