"""Where no room is left, commands say so in one sentence and leave nothing behind."""

import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from carillon.errors import UserError
from sound.__main__ import main
from sound.export.embedded import write_embedded
from sound.project.design_file import write_design
from tests.disks import KIB, disk_on
from tests.small_design import small_design

NO_ROOM = r"could not be written \(No space left on device; make room and run the same command"


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("inputs")
    write_design(path / "design.h5", small_design())
    assert main(["clip", "wood", "--seconds", "0.5", "--out", str(path / "wood.wav")]) == 0
    return path


@pytest.fixture(scope="module")
def small_disk(tmp_path_factory) -> Iterator[Path]:
    """A file system of 8 KiB."""
    path = tmp_path_factory.mktemp("disk")
    with disk_on(path, 8 * KIB):
        yield path


@pytest.mark.parametrize(
    "words",
    [
        ["clip", "metal", "--out", "OUT.wav"],
        ["render", "design.h5", "--target", "side", "--seconds", "1", "--out", "OUT.wav"],
        ["extract", "wood.wav", "--residual", "OUT.wav"],
        ["export", "design.h5", "--out", "OUT.h5"],
        ["export", "design.h5", "--out", "OUT.gltf"],
        ["export", "design.h5", "--out", "OUT.glb"],
        ["export", "design.h5", "--points", "300", "--out", "OUT.dsp"],
        ["export", "design.h5", "--points", "30", "--out", "OUT.js"],
        ["export", "design.h5", "--points", "30", "--out", "OUT.json"],
        ["export", "design.h5", "--variations", "1", "--out", "OUT/"],
    ],
    ids=" ".join,
)
def test_a_full_disk_is_told_in_a_sentence(folder, small_disk, monkeypatch, words, refuses):
    monkeypatch.chdir(folder)
    said = refuses(main, *(word.replace("OUT", str(small_disk / "out")) for word in words))
    assert re.search(NO_ROOM, said)
    assert not list(small_disk.iterdir())


@pytest.mark.parametrize("write", [write_design, partial(write_embedded, parameters={})])
def test_a_file_that_finds_no_room_leaves_the_one_before(small_disk, write):
    path = small_disk / "design.h5"
    path.write_bytes(b"an older one")
    try:
        with pytest.raises(UserError, match=NO_ROOM):
            write(path, small_design())
        assert path.read_bytes() == b"an older one" and len(list(small_disk.iterdir())) == 1
    finally:
        path.unlink()
