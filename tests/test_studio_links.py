"""Folders that came from others: no link, pipe or session in them leads the studio elsewhere."""

import asyncio
import json
import os
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from carillon.errors import UserError
from carillon.files.atomic import atomic_path
from sound.project.design_file import write_design
from studio.server import browser
from studio.session import open_studio
from studio.session.projects import save
from studio.session.workspace import OWN_FOLDER
from tests.edited_files import edited
from tests.small_design import small_design

DIARY = "what nobody else writes to"
PROJECT = "# mine\nmesh: builtin:bar\ntargets:\n  - {name: end, vertex: 0, clip: end.wav}\n"
DOCUMENT = {
    "settings": {"mesh": "builtin:bar"},
    "targets": [],
    "material": None,
    "kept": None,
    "heard": None,
}


@pytest.fixture
def folder(tmp_path) -> Path:
    """A workspace with a project; beside it a home with a diary and a folder of data."""
    home, folder = tmp_path / "home", tmp_path / "pans"
    for each in (home, home / "data", home / "data" / "designs", folder):
        each.mkdir()
    for name in ("diary", "data/5.h5", "data/designs/6.h5"):
        (home / name).write_text(DIARY)
    (folder / "pan.yaml").write_text(PROJECT)
    return folder


@pytest.fixture(autouse=True)
def kept(tmp_path):
    """What is outside of the workspace stays as it is."""
    yield
    files = [path for path in (tmp_path / "home").rglob("*") if path.is_file()]
    assert sorted(path.name for path in files) == ["5.h5", "6.h5", "diary"]
    assert all(path.read_text() == DIARY for path in files)


def begin_and_end(folder: Path, what: str | None = None, do: Callable | None = None) -> None:
    """Open a studio, do something with it, and close it, which saves and tidies up."""

    async def play():
        studio = open_studio(what, folder)
        try:
            if do is not None:
                await do(studio)
        finally:
            await studio.close()

    asyncio.run(play())


def plant(folder: Path, name: str, target: str) -> Path:
    """A link in the workspace that leads into the home, as it comes out of an archive."""
    path = folder / name
    path.parent.mkdir(exist_ok=True, parents=True)
    path.symlink_to(os.path.relpath(folder.parent / "home" / target, path.parent))
    return path


def sentence(caught) -> str:
    text = str(caught.value)
    assert "\n" not in text and text.count(";") >= 1, text
    return text


# ------------------------------------------------------------------ the studio's own files


@pytest.mark.parametrize(
    ("name", "target"),
    [
        (OWN_FOLDER, "data"),
        (f"{OWN_FOLDER}/designs", "data"),
        (f"{OWN_FOLDER}/session.json", "diary"),
        (f"{OWN_FOLDER}/session.json", "new"),
        (f"{OWN_FOLDER}/lock", "diary"),
        (f"{OWN_FOLDER}/lock", "new"),
    ],
)
def test_what_the_studio_keeps_for_itself_is_no_link(folder, name, target):
    link = plant(folder, name, target)
    with pytest.raises(UserError) as caught:
        open_studio(None, folder)
    said = sentence(caught)
    assert str(link) in said and "link" in said and "remove it" in said
    assert link.is_symlink()
    link.unlink()
    begin_and_end(folder)


def make_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(path))


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, make_socket])
@pytest.mark.parametrize("name", ["session.json", "lock"])
def test_what_is_no_file_is_neither_waited_for_nor_replaced(folder, name, make, monkeypatch):
    (folder / OWN_FOLDER).mkdir()
    monkeypatch.chdir(folder / OWN_FOLDER)  # names of sockets are short
    make(Path(name))
    with pytest.raises(UserError) as caught:
        open_studio(None, folder)
    assert f"{OWN_FOLDER}/{name}" in sentence(caught)
    assert not Path(name).is_file()


def test_a_second_name_of_a_file_keeps_its_content(folder):
    """Hard links survive in archives as well: what has two names is replaced, not written to."""
    home = folder.parent / "home"
    (folder / OWN_FOLDER).mkdir()
    for name in ("session.json", "lock", ".session.json.x.partial.json"):
        os.link(home / "diary", folder / OWN_FOLDER / name)
    os.link(home / "diary", folder / "new.yaml")
    os.link(home / "diary", folder / "new.yaml~")
    begin_and_end(folder, str(folder / "pan.yaml"), lambda studio: written(studio, "new"))
    assert json.loads((folder / OWN_FOLDER / "session.json").read_text())["name"] == "new"
    assert (folder / "new.yaml").read_text() != DIARY == (folder / "new.yaml~").read_text()


def test_links_and_pipes_of_temporary_names_are_left_alone(folder):
    own = folder / OWN_FOLDER
    link = plant(folder, f"{OWN_FOLDER}/.session.json.a.partial.json", "diary")
    os.mkfifo(own / ".session.json.b.partial.json")
    (own / ".session.json.c.partial.json").write_text("what a killed studio left")
    begin_and_end(folder)
    assert link.is_symlink()
    assert {path.name for path in own.iterdir()} == {
        "designs",
        "session.json",
        link.name,
        ".session.json.b.partial.json",
    }


def test_other_writers_leave_planted_temporary_names_alone(folder):
    link = plant(folder, ".text.a.partial", "diary")
    os.mkfifo(folder / ".text.b.partial")
    with atomic_path(folder / "text") as temporary:
        temporary.write_text("whole")
    assert link.is_symlink() and (folder / ".text.b.partial").is_fifo()


def test_designs_that_are_links_are_neither_written_to_nor_removed(folder):
    own = plant(folder, f"{OWN_FOLDER}/designs/1.h5", "new.h5").parent
    for name in ("notes.h5", "²" + ".h5", "9" * 190 + ".h5", "7.h5"):
        (own / name).write_text("")

    async def look(studio):
        assert studio.session.workspace.new_design() == own / "8.h5"

    begin_and_end(folder, do=look)
    names = {path.name for path in own.iterdir()}
    assert names == {"1.h5", "notes.h5", "²" + ".h5", "9" * 190 + ".h5"}


def test_exports_are_made_where_nothing_was_planted(folder, monkeypatch):
    for name in ("export.npy", "export-1"):
        plant(folder, f"{OWN_FOLDER}/{name}", "diary")
    left = folder / OWN_FOLDER / "export-2"
    left.mkdir()
    (left / "export.npy").write_text("of a killed studio")

    async def export(studio):
        async def designed(state):
            return "design.h5"

        async def make(call, design, kind, target, out, name, seconds):
            with atomic_path(out) as temporary:
                temporary.write_bytes(b"moduli")

        monkeypatch.setattr("studio.session.studio.designed", designed)
        studio._exports.call = make
        assert (await studio.export("npy", None)).content == b"moduli"

    begin_and_end(folder, do=export)
    names = {path.name for path in (folder / OWN_FOLDER).iterdir()}
    assert names == {"designs", "export.npy", "export-1", "session.json"}


# ------------------------------------------------------------------------------ what is saved


async def written(studio, name: str) -> None:
    """Save a project whose design was never sought."""
    await save(studio.session, name)


@pytest.mark.parametrize("name", ["pan.yaml~", "pan.h5", "new.yaml", "new.yaml~", "new.h5"])
@pytest.mark.parametrize("target", ["diary", "new"])
def test_saving_follows_no_link_and_writes_nothing_before(folder, name, target):
    link = plant(folder, name, target)
    if name == "pan.h5":  # what goes with the project is read, too
        with pytest.raises(UserError, match="outside of the workspace"):
            open_studio(str(folder / "pan.yaml"), folder)
        return

    async def saved(studio):
        with pytest.raises(UserError) as caught:
            await written(studio, link.name.partition(".")[0])
        assert f"{link}: is a link" in sentence(caught)

    begin_and_end(folder, str(folder / "pan.yaml"), saved)
    assert (folder / "pan.yaml").read_text() == PROJECT and link.is_symlink()
    assert {path.name for path in folder.iterdir()} == {"pan.yaml", OWN_FOLDER, name}


def test_a_link_within_the_workspace_is_read_and_not_written_to(folder):
    (folder / "pan.yaml").rename(folder / "real.yaml")
    (folder / "pan.yaml").symlink_to("real.yaml")

    async def saved(studio):
        with pytest.raises(UserError, match="is a link"):
            await written(studio, "pan")
        await written(studio, "other")

    begin_and_end(folder, str(folder / "pan.yaml"), saved)
    assert (folder / "real.yaml").read_text() == PROJECT
    assert "builtin:bar" in (folder / "other.yaml").read_text()


@pytest.mark.parametrize(
    "name",
    ["", ".", "..", "a/b", "../pan", "a\0b", "a\nb", "a\n", "a b", "pan.yaml", "é", "a" * 65, ".a"],
)
def test_projects_have_plain_names(folder, name):
    async def saved(studio):
        with pytest.raises(UserError, match="letters, digits"):
            await written(studio, name)

    begin_and_end(folder, str(folder / "pan.yaml"), saved)
    assert (folder / "pan.yaml").read_text() == PROJECT


def test_uploads_take_names_that_nothing_has(folder):
    plant(folder, "a.stl", "new.stl")
    plant(folder, "a-2.stl", "diary")
    os.mkfifo(folder / "a-3.stl")

    async def put(studio):
        assert studio.session.workspace.put("a.stl", b"solid") == "a-4.stl"
        assert studio.session.workspace.put("a.stl", DIARY.encode()) == "a-5.stl"
        assert studio.session.workspace.put("a.stl", b"solid") == "a-4.stl"
        for name in ("../a.stl", "/a.stl", "..", "a\0.stl", "a\n.stl", "a" * 250 + ".stl"):
            with pytest.raises(UserError):
                studio.session.workspace.put(name, b"solid")

    begin_and_end(folder, do=put)
    assert (folder / "a-4.stl").read_bytes() == b"solid"


# ------------------------------------------------------------------------- sessions and names


def session(folder: Path, before: list | None = None, **changes: object) -> None:
    """What a studio was left with, or so it says."""
    (folder / OWN_FOLDER / "designs").mkdir(parents=True)
    history = {"document": {**DOCUMENT, **changes}, "before": before or [], "after": []}
    content = {"name": "pan", "saved": False, "searching": False, "fine": False}
    (folder / OWN_FOLDER / "session.json").write_text(json.dumps({**content, "history": history}))


ELSEWHERE = {
    "a mesh": {"settings": {"mesh": "../home/diary"}},
    "a forest": {"settings": {"mesh": "builtin:bar", "forest": "../home/diary"}},
    "a clip": {"targets": [{"name": "a", "vertex": 0, "clip": "../home/diary"}]},
    "a design": {"material": {"z": [], "design": "../home/data/5.h5"}},
    "a design that is kept": {"kept": {"z": [], "design": "/home/data/5.h5"}, "heard": "A"},
    "a mesh by a link": {"settings": {"mesh": "link.obj"}},
    "a design by a link": {"material": {"z": [], "design": f"{OWN_FOLDER}/designs/1.h5"}},
}


@pytest.mark.parametrize("is_before", [False, True])
@pytest.mark.parametrize("what", ELSEWHERE)
def test_a_session_that_names_files_elsewhere_is_refused(folder, what, is_before):
    step = [["open", {**DOCUMENT, **ELSEWHERE[what]}]]
    session(folder, **({"before": step} if is_before else ELSEWHERE[what]))
    plant(folder, "link.obj", "diary")
    plant(folder, f"{OWN_FOLDER}/designs/1.h5", "data/5.h5")
    content = (folder / OWN_FOLDER / "session.json").read_text()
    for asked in (None, str(folder / "pan.yaml")):
        with pytest.raises(UserError) as caught:
            open_studio(asked, folder)
        said = sentence(caught)
        assert "outside of the workspace" in said and "remove this file" in said
    assert (folder / OWN_FOLDER / "session.json").read_text() == content


MALFORMED = {
    "nothing": "",
    "a list": "[]",
    "null": "null",
    "half an object": "{",
    "deep": "[" * 100_000,
    "no history": '{"name": "a", "saved": false}',
    "settings of another kind": {"settings": {"mesh": "builtin:bar", "material": 5}},
    "settings that are a list": {"settings": []},
    "targets that are a number": {"targets": 5},
    "a mesh with a null byte": {"settings": {"mesh": "a\0b"}},
    "a design that is a number": {"material": {"z": [], "design": 5}},
    "a material that is no number": {"material": {"z": [float("nan")], "design": None}},
    "a material that is no material": {"material": 5},
    "a letter that is none": {"heard": "C"},
}


@pytest.mark.parametrize("what", MALFORMED)
def test_a_session_that_is_none_is_not_gone_on_with(folder, what, capsys):
    given = MALFORMED[what]
    session(folder, **({} if isinstance(given, str) else given))
    if isinstance(given, str):
        (folder / OWN_FOLDER / "session.json").write_text(given)

    async def look(studio):
        assert studio.session.document.mesh is None and studio.session.name == "untitled"
        assert studio.state()["saved"]

    begin_and_end(folder, do=look)
    assert "Traceback" not in capsys.readouterr().err


def test_a_session_goes_on_after_its_folder_was_moved(folder):
    """Designs are named by where they are in the folder, also if it once lay elsewhere."""
    name = f"{OWN_FOLDER}/designs/3.h5"
    session(folder, material={"z": [1.0], "design": f"/former/place/{name}"})
    (folder / name).write_text("a design")
    begin_and_end(folder)
    assert (folder / name).read_text() == "a design"
    content = json.loads((folder / OWN_FOLDER / "session.json").read_text())
    assert content["history"]["document"]["material"]["design"] == name
    moved = folder.rename(folder.with_name("moved"))

    async def look(studio):
        assert studio.session.document.material.design == str(moved / name)

    begin_and_end(moved, do=look)


def test_a_workspace_may_be_reached_through_a_link(folder):
    link = folder.with_name("link")
    link.symlink_to(folder, target_is_directory=True)
    begin_and_end(link, str(link / "pan.yaml"), lambda studio: written(studio, "pan"))
    assert (folder / "pan.yaml~").read_text() == PROJECT
    assert (folder / OWN_FOLDER / "session.json").is_file()


def test_a_mesh_that_is_a_link_to_elsewhere_is_one_outside(folder):
    plant(folder, "mesh.obj", "diary")
    (folder / "pan.yaml").write_text(PROJECT.replace("builtin:bar", "mesh.obj"))
    with pytest.raises(UserError, match=r"mesh.obj: lies outside of the workspace"):
        open_studio(str(folder / "pan.yaml"), folder)

    async def look(studio):
        assert (
            studio.session.document.mesh == "mesh-2.obj"
        )  # a copy, since the person named the link
        assert not (folder / "mesh-2.obj").is_symlink()

    begin_and_end(folder, str(folder / "mesh.obj"), look)


def test_a_project_is_opened_where_it_is_and_nowhere_else(folder):
    (folder / "below").mkdir()
    (folder / "below" / "pan.yaml").write_text(PROJECT)
    with pytest.raises(UserError, match="directly in it"):
        open_studio(str(folder / "below" / "pan.yaml"), folder)


@pytest.mark.parametrize("name", ["a\0b", "../home/diary", "a/../../home", "/etc/passwd"])
def test_names_that_lead_out_are_one_sentence(folder, name):
    async def look(studio):
        with pytest.raises(UserError) as caught:
            studio.session.workspace.path(name)
        assert "expected" in str(caught.value)

    begin_and_end(folder, do=look)


DESIGNS = {
    "a list": [],
    "targets that are a number": {"mesh": "builtin:bar", "targets": 5},
    "targets of another kind": {"mesh": "builtin:bar", "targets": [5]},
    "no targets": {"mesh": "builtin:bar"},
    "a forest with a null byte": {
        "mesh": "builtin:bar",
        "forest": "a\0b",
        "targets": [{"name": "a", "vertex": 0, "clip": "a.wav"}],
    },
    "a mesh elsewhere": {
        "mesh": "../home/diary",
        "targets": [{"name": "a", "vertex": 0, "clip": "a.wav"}],
    },
}


@pytest.mark.parametrize("what", DESIGNS)
def test_a_design_of_odd_settings_is_refused_in_one_sentence(folder, what):
    path = folder / "design.h5"
    write_design(path, small_design())
    with edited(path) as file:
        file["settings"][()] = json.dumps(DESIGNS[what])
    with pytest.raises(UserError) as caught:
        open_studio(str(path), folder)
    assert "expected" in sentence(caught)


@pytest.mark.parametrize(
    "name", ["a\nb", "\udcff", "-", "~", "..", "a b", "é", "x" * 250, "a.yaml"]
)
def test_projects_of_odd_names_are_listed_and_opened_or_refused(folder, name):
    (folder / "pan.yaml").rename(folder / f"{name}.yaml")

    async def look(studio):
        (listed,) = studio.state()["projects"]
        assert listed["name"] == name
        await studio.call("open_project", {"project": listed["project"]})
        json.dumps(studio.state()).encode()
        with pytest.raises(UserError):
            await written(studio, f"{name}/")

    begin_and_end(folder, do=look)
    assert (folder / f"{name}.yaml").read_text() == PROJECT


def test_the_page_that_leads_the_browser_is_written_through_no_link(folder, monkeypatch):
    link = plant(folder, browser.NAME, "diary")
    monkeypatch.setenv("BROWSER", "made-up")
    monkeypatch.setattr("studio.server.browser.webbrowser.open", lambda address: True)
    assert browser.open_page("http://127.0.0.1:1/?token=secret", folder) == link
    assert not link.is_symlink() and "secret" in link.read_text()
