"""A folder that is held open: names in it, whole files, and nothing by way of links."""

import os

import pytest

from carillon.errors import UserError
from carillon.files import open_folder, system
from carillon.files.held_folder import HeldFolder


@pytest.fixture(params=["held open", "by its path"])
def held(request, tmp_path, monkeypatch):
    """A folder, also as Windows has it."""
    if request.param == "by its path":
        monkeypatch.setattr(open_folder, "CAN_BE_HELD", False)
        monkeypatch.setattr(system, "RENAMES_OPEN", False)
    (tmp_path / "inner").mkdir()
    found = HeldFolder(tmp_path / "inner")
    yield found
    found.close()


def test_what_is_written_is_whole_and_replaces_what_was_there(held):
    other = held.path / "other"
    held.write("text", b"first")
    os.link(held.path / "text", other)
    held.write("text", b"second")
    assert held.read("text", 6) == b"second" and other.read_bytes() == b"first"
    assert sorted(held.names()) == ["other", "text"]
    umask = os.umask(0)
    os.umask(umask)
    assert (held.path / "text").stat().st_mode & 0o777 == 0o666 & ~umask
    with pytest.raises(UserError, match="longer than 5 bytes"):
        held.read("text", 5)


def test_nothing_half_written_stays(held):
    held.write("text", b"first")
    with pytest.raises(ZeroDivisionError), held.writing("text") as stream:
        stream.write(b"half" * 100_000)
        raise ZeroDivisionError
    with pytest.raises(UserError, match="could not be written"), held.writing("text") as stream:
        stream.write(b"half")
        raise OSError(28, "No space left on device")
    assert held.read("text", 100) == b"first" and held.names() == ["text"]


def test_a_link_that_comes_while_something_is_written_is_not_replaced(held, tmp_path):
    with pytest.raises(UserError, match="is a link"), held.writing("text") as stream:
        stream.write(b"hours of work")
        (held.path / "text").symlink_to(tmp_path / "elsewhere")
    assert held.names() == ["text"] and not (tmp_path / "elsewhere").exists()


@pytest.mark.parametrize("held", ["held open"], indirect=True)
def test_another_folder_in_its_place_gets_nothing(held, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    held.path.rename(tmp_path / "moved")
    held.path.symlink_to(tmp_path / "elsewhere")
    held.write("text", b"mine")
    inner = held.child("designs")
    inner.write("1.h5", b"mine")
    inner.close()
    assert not list((tmp_path / "elsewhere").iterdir())
    assert (tmp_path / "moved" / "designs" / "1.h5").read_bytes() == b"mine"


@pytest.mark.parametrize("held", ["held open"], indirect=True)
def test_leftovers_go_and_writers_under_way_stay(held):
    (held.path / ".text.dead.partial").write_text("half")
    with held.writing("text") as first:
        assert ".text.dead.partial" not in held.names()
        first.write(b"first")
        held.write("text", b"second")
        assert held.read("text", 9) == b"second"
    assert held.read("text", 9) == b"first" and held.names() == ["text"]


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, lambda path: path.symlink_to("text")])
def test_what_is_no_file_is_neither_read_nor_written(held, make):
    make(held.path / "odd")
    for use in (lambda: held.read("odd", 9), lambda: held.write("odd", b"")):
        with pytest.raises(UserError, match=r"is a (pipe|folder|link), expected a file"):
            use()
    assert held.has("odd") and not held.has_file("odd")
    with pytest.raises(UserError, match="no such file"):
        held.read("nothing", 9)


def test_a_folder_below_is_made_and_is_no_link(held):
    held.child("below").close()
    held.child("below").close()
    (held.path / "link").symlink_to("below")
    with pytest.raises(UserError, match="is a link, expected a folder"):
        held.child("link")


@pytest.mark.parametrize("name", ["", ".", "..", "a/b", "/a", "../a", "a\0b"])
def test_names_lead_nowhere_else(held, name):
    for use in (held.has, held.child, held.remove, lambda name: held.write(name, b"")):
        with pytest.raises(UserError, match="no name of a file"):
            use(name)


def test_passing_folders_are_gone_with_all_that_is_in_them(held, tmp_path):
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside" / "text").write_text("kept")
    with held.passing("export-") as folder:
        (folder / "link").symlink_to(tmp_path / "outside")
        (folder / "file").write_text("passing")
    assert held.names() == []
    (held.path / "export-1").symlink_to(tmp_path / "outside")
    (held.path / "export-2").mkdir()
    held.remove_passing("export-")
    assert held.names() == ["export-1"]
    assert (tmp_path / "outside" / "text").read_text() == "kept"
