"""What a studio designs: documents, their undo, and files that stay in the workspace."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from carillon.errors import UserError
from sound.project.project import load_project
from studio.session.document import (
    LONGEST,
    Document,
    History,
    Material,
    Target,
    document_of,
    merged,
)
from studio.session.workspace import Workspace

BELL = Document({"mesh": "builtin:bell", "resolution": 8})
STRUCK = replace(
    BELL,
    targets=(
        Target("rim", vertex=3, clip="rim.wav", without=(440.0,)),
        Target("top", at=(0.0, 0.0, 0.2), clip="top.wav", allow_clipped=True),
        Target("first", vertex=0, clip="rim.wav"),
        Target("silent", vertex=9),
    ),
    material=Material((0.1, -0.2), "1.h5"),
)


@pytest.fixture
def workspace(tmp_path):
    (tmp_path / "work").mkdir()
    opened = Workspace(tmp_path / "work")
    yield opened
    opened.close()


def test_a_document_is_the_same_after_a_project_file(workspace):
    """But for targets that have no clip yet, and what no project tells."""
    workspace.write_project("bell", STRUCK.described())
    read = document_of(workspace.read_project("bell"))
    assert read.targets == STRUCK.targets[:3]
    assert {key: read.settings[key] for key in BELL.settings} == BELL.settings
    project = load_project(workspace.folder / "bell.yaml")
    assert [target.without for target in project.targets] == [(440.0,), (), ()]


def test_a_project_that_was_edited_by_hand_stays_beside_what_is_saved(workspace):
    file, former = workspace.folder / "bell.yaml", workspace.folder / "bell.yaml~"
    workspace.write_project("bell", STRUCK.described())
    workspace.write_project("bell", STRUCK.described())
    assert not former.exists()
    edited = file.read_text() + "# the one for the concert\n"
    file.write_text(edited)
    workspace.write_project("bell", replace(STRUCK, targets=STRUCK.targets[:1]).described())
    assert former.read_text() == edited and file.read_text() != edited
    file.write_bytes(b"mesh: \xff")
    workspace.write_project("bell", STRUCK.described())
    assert former.read_bytes() == b"mesh: \xff"


def test_a_history_is_the_same_after_json():
    history = History(BELL)
    for document in (STRUCK, replace(STRUCK, material=None), BELL):
        history.do("something", document)
    history.undo()
    assert History.from_json(json.loads(json.dumps(history.as_json()))) == history


def test_undo_leads_through_all_that_was_done_and_redo_back():
    documents = [replace(BELL, settings={**BELL.settings, "resolution": n}) for n in range(8, 20)]
    history = History(documents[0])
    for number, document in enumerate(documents[1:]):
        history.do(f"step {number}", document)
    for document in documents[-2::-1]:
        assert history.undo()
        assert history.document == document
    assert not history.undo() and history.undo_name is None
    for document in documents[1:]:
        assert history.redo()
        assert history.document == document
    assert not history.redo()
    history.undo()
    history.do("other", BELL)
    assert history.redo_name is None


def test_undo_forgets_what_is_longest_ago():
    history = History(BELL)
    for number in range(LONGEST + 50):
        history.do(str(number), replace(BELL, material=Material((float(number),))))
    assert len(history.before) == LONGEST


@pytest.mark.parametrize(
    ("document", "word"),
    [
        (Document({"mesh": "builtin:bell", "resolution": 0}), "resolution"),
        (Document({"mesh": "builtin:bell", "resolutoin": 8}), "resolution?"),
        (replace(BELL, targets=(Target("a", vertex=-1),)), "vertex"),
        (replace(BELL, targets=(Target("a", vertex=1), Target("a", vertex=2))), "another name"),
        (replace(BELL, targets=(Target("\n", vertex=1),)), "printed"),
        (replace(BELL, targets=(Target("a"),)), "vertex"),
        (Document({}), "mesh"),
    ],
)
def test_what_is_no_project_is_refused_in_one_sentence(document, word, tmp_path):
    with pytest.raises(UserError, match=word):
        document.require_sound(tmp_path)


def test_settings_are_merged_by_section():
    deep = merged({"weights": {"frequency": 2.0}, "unit": 1.0}, {"weights": {"amplitude": 3.0}})
    assert deep == {"weights": {"frequency": 2.0, "amplitude": 3.0}, "unit": 1.0}


@pytest.mark.parametrize("name", ["../pan", "/etc/passwd", "a/../../b", "..", "link/pan.wav"])
def test_nothing_leads_out_of_the_workspace(workspace, name):
    (workspace.folder / "link").symlink_to(workspace.folder.parent)
    with pytest.raises(UserError, match="outside of the workspace"):
        workspace.path(name)


def test_one_studio_works_in_a_folder(workspace):
    with pytest.raises(UserError, match="another studio"):
        Workspace(workspace.folder)


def test_designs_that_nobody_needs_are_removed(workspace):
    paths = []
    for _ in range(3):
        paths.append(workspace.new_design())
        paths[-1].touch()
    workspace.forget_designs({str(paths[1])})
    assert [path.exists() for path in paths] == [False, True, False]


def test_projects_are_listed_without_what_is_the_studio_s_own(workspace):
    for name in ("b", "a"):
        workspace.write_project(name, STRUCK.described())
    (workspace.folder / "folder.yaml").mkdir()
    assert workspace.projects() == ["a", "b"]
    assert yaml.safe_load((workspace.folder / "a.yaml").read_text())["resolution"] == 8
    assert Path(workspace.path("a.h5")).name == "a.h5"
