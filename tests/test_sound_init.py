"""`sound init`: a project with all keys in it, which is a project as it is."""

import json
import os
import re
import shutil
from pathlib import Path

import pytest
import trimesh
import yaml

from carillon.parameters.documents import with_defaults
from carillon.parameters.schema import schema_of
from sound.__main__ import main
from sound.clips.targets import MOST_MODES
from sound.design.preparation import targets_of
from sound.project.design_file import read_design
from sound.project.project import Project, load_project, project_of
from studio.session import open_studio

SCHEMA = schema_of(Project)
_KEY_BEHIND_A_MARK = re.compile(r"^( *)#( *[a-z_]+:)", re.MULTILINE)


@pytest.fixture(scope="module")
def clips(tmp_path_factory) -> Path:
    """Folder with a clip of many modes and one of few."""
    folder = tmp_path_factory.mktemp("clips")
    for name in ("metal", "wood"):
        words = ["--seconds", "0.5", "--rate", "22050", "--out", str(folder / f"{name}.wav")]
        assert main(["clip", name, *words]) == 0
    return folder


@pytest.fixture
def here(clips, tmp_path, monkeypatch) -> Path:
    """A folder with the clips in it, where commands are typed."""
    for clip in clips.iterdir():
        shutil.copy(clip, tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def written(path: Path, *clips: str) -> str:
    assert main(["init", str(path), "--mesh", "builtin:bar", *clips]) == 0
    return path.read_text()


def without_marks(text: str) -> str:
    return _KEY_BEHIND_A_MARK.sub(r"\1\2", text)


def test_what_is_not_asked_for_has_its_default(here):
    described = yaml.safe_load(written(here / "bar.yaml", "--clips", "metal.wav"))
    defaults = with_defaults({key: described[key] for key in ("mesh", "targets")}, Project)
    filled = load_project(here / "bar.yaml").as_dict()
    for key in SCHEMA["properties"]:
        if key not in ("mesh", "targets", "coarsen"):
            assert filled[key] == defaults[key], key
    assert defaults["coarsen"] == "auto" and filled["coarsen"] == "ddfem"


def test_every_key_is_there_with_its_default_and_its_meaning(here):
    text = written(here / "bar.yaml", "--clips", "wood.wav", "metal.wav")
    everything = yaml.safe_load(without_marks(text))
    assert set(everything) == set(SCHEMA["properties"])
    assert project_of(everything, here) == load_project(here / "bar.yaml")
    target = SCHEMA["properties"]["targets"]["items"]
    assert set(everything["targets"][0]) == set(target["properties"])
    for part in (SCHEMA, target, *SCHEMA["properties"].values()):
        for each in part.get("properties", {}).values():
            assert re.search(rf"# {re.escape(each['description'])}( \(|$)", text, re.MULTILINE)


def test_the_number_of_modes_is_left_to_the_clips(here):
    main(["extract", "wood.wav", "--out", "wood.json"])
    count = len(json.loads(Path("wood.json").read_text())["frequencies_hz"])
    assert "#modes: auto" in written(here / "bar.yaml", "--clips", "wood.wav")
    assert len(targets_of(load_project(here / "bar.yaml")).frequencies) == count < MOST_MODES


def test_points_are_on_the_surface_and_apart(here):
    written(here / "bar.yaml", "--clips", "metal.wav", "wood.wav", "metal.wav")
    project = load_project(here / "bar.yaml")
    assert [target.name for target in project.targets] == ["clip 1", "clip 2", "clip 3"]
    assert len(project.strikes(project.surface())) == 3


def test_a_design_is_made_of_it_as_it_is(here):
    written(here / "bar.yaml", "--clips", "metal.wav", "wood.wav")
    assert main(["design", "bar.yaml", "--evaluations", "2", "--out", "bar.h5"]) == 0
    design = read_design("bar.h5")
    assert design.settings["modes"] == len(design.frequencies) <= MOST_MODES
    session = open_studio("bar.h5", here).session
    session.workspace.close()
    assert session.document.settings.get("modes", "auto") == "auto"


def test_a_design_of_a_number_of_modes_is_gone_on_from_with_all(here):
    text = written(here / "bar.yaml", "--clips", "wood.wav")
    Path("three.yaml").write_text(text.replace("#modes: auto", "modes: 3"))
    for name in ("three", "bar"):
        words = ["design", f"{name}.yaml", "--evaluations", "1", "--workers", "1"]
        assert main([*words, "--out", "bar.h5"]) == 0
        design = read_design("bar.h5")
        assert design.settings["modes"] == len(design.frequencies)
        assert len(design.frequencies) == 3 or name == "bar"
        assert design.asked["modes"] == (3 if name == "three" else "auto")
    assert len(design.targets.sounding) + len(design.targets.left_out) == 5
    assert design.history["evaluations"].tolist()[-1] == 2


def test_files_are_named_as_the_project_sees_them(here):
    (here / "projects").mkdir()
    shutil.copy("metal.wav", "läute 鐘.wav")
    assert main(["init", "projects", "--mesh", "builtin:bar", "--clips", "läute 鐘.wav"]) == 0
    project = load_project(here / "projects" / "project.yaml")
    assert project.targets[0].name == "läute 鐘"
    assert Path(project.targets[0].clip).resolve() == here.resolve() / "läute 鐘.wav"


def test_a_folder_that_is_made_has_all_that_its_project_names(here, capsys):
    trimesh.creation.box((0.1, 0.02, 0.02)).export("Bär.stl")
    (here / "other").mkdir()
    shutil.copy("wood.wav", "other/metal.wav")
    clips = ["metal.wav", str(here / "other" / "metal.wav")]
    assert main(["init", "given", "--mesh", "Bär.stl", "--clips", *clips]) == 0
    assert "with copies of Bär.stl and metal.wav and metal-2.wav" in capsys.readouterr().out
    assert sorted(os.listdir("given")) == ["Bär.stl", "metal-2.wav", "metal.wav", "project.yaml"]
    assert (here / "given" / "metal-2.wav").read_bytes() == (here / "wood.wav").read_bytes()
    shutil.move("given", "moved")
    project = load_project(here / "moved" / "project.yaml")
    assert [Path(each.clip).name for each in project.targets] == ["metal.wav", "metal-2.wav"]
    open_studio(str(here / "moved" / "project.yaml"), here / "moved").session.workspace.close()


def test_a_mesh_that_names_others_stays_where_it_is(here):
    trimesh.creation.box((0.1, 0.02, 0.02)).export("bar.gltf")
    assert main(["init", "gltf", "--mesh", "bar.gltf", "--unit", "m"]) == 0
    assert yaml.safe_load(Path("gltf/project.yaml").read_text())["mesh"] == "../bar.gltf"


def test_a_folder_that_cannot_be_filled_is_not_left(here, refuses, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(shutil, "copyfile", full)
    said = refuses(main, "init", "full", "--mesh", "builtin:bar", "--clips", "metal.wav")
    assert "full: could not be written (No space left" in said and not os.path.exists("full")


def test_without_a_clip_one_is_to_be_recorded(here, capsys):
    assert yaml.safe_load(written(here / "bar.yaml"))["targets"][0]["clip"] == "clip.wav"
    assert "clip.wav" in capsys.readouterr().out
    shutil.copy("metal.wav", "clip.wav")
    assert len(targets_of(load_project(here / "bar.yaml")).frequencies) > 2


def test_a_shell_is_advised_by_an_option_that_there_is(here, caplog):
    bowl = trimesh.creation.icosphere(radius=0.1)
    bowl.update_faces(bowl.triangles_center[:, 2] < 0.03)
    bowl.export("bowl.obj")
    assert main(["init", "full.yaml", "--mesh", "bowl.obj"]) == 0
    (wall,) = re.findall("give (--wall .*)", caplog.text)
    assert main(["init", "shell.yaml", "--mesh", "bowl.obj", *wall.split()]) == 0
    assert yaml.safe_load(Path("shell.yaml").read_text())["discretisation"] == "finite-cell"


def test_nothing_is_overwritten(here, refuses):
    (here / "bar.yaml").write_text("mine")
    said = refuses(main, "init", "bar.yaml", "--mesh", "builtin:bar")
    assert "bar.yaml: is there already" in said
    assert (here / "bar.yaml").read_text() == "mine"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["bar.txt", "--mesh", "builtin:bar"], "bar.txt: ends in .txt, expected .* .yaml or .yml"),
        (["bar.yaml", "--mesh", "builtin:bra"], "bra"),
        (["bar.yaml", "--mesh", "bar.obj"], "bar.obj: no such file"),
        (["bar.yaml", "--mesh", "builtin:bar", "--clips", "none.wav"], "none.wav: no such file"),
        (["bar.yaml"], "--mesh"),
    ],
)
def test_a_mistake_is_answered_in_one_sentence(here, refuses, words, says):
    assert re.search(says, refuses(main, "init", *words))
    assert not (here / "bar.yaml").exists()


def test_faults_of_all_clips_are_told_before_any_is_searched(here, capsys, monkeypatch):
    monkeypatch.setattr("sound.clips.files.extract_file", lambda *_, **__: pytest.fail("searched"))
    Path("text.wav").write_text("no sound")
    words = ["--clips", "metal.wav", "text.wav", "gone.wav"]
    assert main(["init", "bar.yaml", "--mesh", "builtin:bar", *words]) == 2
    said = capsys.readouterr().err
    assert "text.wav" in said and "gone.wav" in said and not Path("bar.yaml").exists()
