"""Digests of result files: equal for equal results, and of nothing else than results."""

import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

import carillon as ca
from carillon.errors import UserError
from sound.project.design_file import SCHEMA, write_design
from tests.small_design import small_design
from workflow.__main__ import main
from workflow.commands.digest import digest


@pytest.fixture(scope="module")
def design(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("design") / "design.h5"
    write_design(path, small_design())
    return path


def test_of_two_folders_what_differs_is_told(design, tmp_path, capsys):
    for folder, names in (("one", "ab"), ("two", "abc")):
        (tmp_path / folder).mkdir()
        for name in names:
            shutil.copy(design, tmp_path / folder / f"{name}.h5")
    told = []
    for _ in range(2):
        assert main(["digest", str(tmp_path / "one"), str(tmp_path / "two")]) == 0
        told.append(capsys.readouterr().out.splitlines()[-1])
        ca.generate(tmp_path / "b.h5", 10)
        (tmp_path / "b.h5").rename(tmp_path / "two" / "b.h5")
    assert told == [
        "2 files in both, all equal; 1 in one of them alone",
        "2 files in both, 1 differ: b.h5; 1 in one of them alone",
    ]


def test_equal_designs_have_equal_digests_however_long_they_took(design, tmp_path):
    made = small_design()
    history = made.history.copy()
    history["seconds"] *= 3.0
    slower = {"seconds": 2.7, "evaluations_per_minute": 200.0, "workers": 2}
    again = replace(made, history=history, evidence=made.evidence | slower)
    write_design(tmp_path / "again.h5", again)
    assert digest(tmp_path / "again.h5") == digest(design)
    elsewhere = replace(made, settings=made.settings | {"mesh": str(tmp_path / "box.obj")})
    write_design(tmp_path / "elsewhere.h5", elsewhere)
    assert digest(tmp_path / "elsewhere.h5") == digest(design)


def test_what_was_found_counts(design, tmp_path):
    made = small_design()
    young, history = made.young.copy(), made.history.copy()
    young[3] = np.nextafter(young[3], np.inf)
    history["evaluations"][-1] += 1
    names = replace(made.targets, names=("corner", "edge"))
    digests = {digest(design)}
    others = (
        replace(made, young=young),
        replace(made, history=history),
        replace(made, targets=names),
        replace(made, evidence={"stopped": "by hand"}),
    )
    for number, other in enumerate(others):
        path = tmp_path / f"{number}.h5"
        write_design(path, other)
        digests.add(digest(path))
    assert len(digests) == 1 + len(others)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda content: content[:-100], "damaged"),
        (lambda content: content[:3000] + b"\1" + content[3001:], "checksum"),
        (lambda content: bytes(512) + content[512:], "its checksum is gone"),
        (lambda content: content[512:], "its checksum is gone"),
        (lambda content: content[:600], "no HDF5 file"),
        (lambda content: b"", "no HDF5 file"),
        (lambda content: b"RIFF, a sound", "no HDF5 file"),
    ],
)
def test_a_file_that_is_not_whole_has_none(design, tmp_path, change, says):
    path = tmp_path / "design.h5"
    path.write_bytes(change(design.read_bytes()))
    with pytest.raises(UserError) as caught:
        digest(path)
    assert says in str(caught.value) and str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("attributes", "says"),
    [
        ({}, "no HDF5 file of this project"),
        ({"kind": "design"}, "no HDF5 file of this project"),
        ({"kind": "design", "schema_version": "x"}, "no HDF5 file of this project"),
        ({"kind": "design", "schema_version": SCHEMA}, "its checksum is gone"),
    ],
)
def test_hdf5_of_others_has_none(tmp_path, attributes, says):
    path = tmp_path / "other.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("huge", (10**14,), "f8", chunks=(10**6,))
        file.attrs.update(attributes)
    with pytest.raises(UserError, match=says):
        digest(path)


@pytest.mark.parametrize("name", ["absent.h5", "/dev/null", "x" * 5000, "empty"])
def test_paths_without_results_are_told(tmp_path, monkeypatch, name, refuses):
    monkeypatch.chdir(tmp_path)
    Path("empty").mkdir()
    Path("empty", ".design.h5.x.partial.h5").write_bytes(b"left by a killed writer")
    assert name[:20] in refuses(main, "digest", name)
