"""A search that goes on while its project is edited, and what is written of it."""

import copy
import os
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
import yaml

from carillon.errors import UserError
from sound.__main__ import main
from sound.commands import watching
from sound.commands.watching import EditedProject
from sound.project.design_file import read_design
from sound.project.project import load_project
from tests import small_project
from tests.patience import HANG_SECONDS

FREQUENCIES = np.array([500.0, 1200.0, 1900.0, 2600.0, 3300.0, 4100.0])


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """A project with its clips; what is waited for comes at once."""
    monkeypatch.chdir(tmp_path)
    for name in ("LOOK_SECONDS", "WRITE_SECONDS"):
        monkeypatch.setattr(watching, name, 0.01)
    small_project.write_clips(tmp_path, FREQUENCIES)
    write(tmp_path)
    return tmp_path


def write(folder: Path, **changes: Any) -> None:
    content = copy.deepcopy(small_project.PROJECT) | changes
    partial = folder / "project.yaml.partial"
    partial.write_text(yaml.safe_dump(content))
    partial.replace(folder / "project.yaml")


def looks(edited: EditedProject, count: int = 3) -> list[bool]:
    found = []
    for _ in range(count):
        time.sleep(0.02)
        found.append(edited.has_changed())
    return found


def test_an_edit_is_taken_up_once_and_when_it_is_whole(folder, capsys):
    path = folder / "project.yaml"
    edited = EditedProject(path, lambda: load_project(path))
    assert looks(edited) == [False] * 3
    write(folder, weights={"amplitude": 3.0})
    assert looks(edited) == [False, True, False]
    assert edited.project.weights.amplitude == 3.0
    path.write_text(path.read_text() + "# a remark\n")
    assert looks(edited) == [False] * 3
    for broken in ("weights: [", "mesh: builtin:bar\n", "targets: 5\n"):
        path.write_text(broken)
        assert looks(edited) == [False] * 3
        said = capsys.readouterr().err.splitlines()
        assert len(said) == 1 and "going on with the project as it was" in said[0]
        assert "project.yaml" in said[0]
    path.unlink()
    assert looks(edited) == [False] * 3
    assert "no such file" in capsys.readouterr().err
    write(folder, weights={"amplitude": 4.0})
    assert looks(edited) == [False, True, False]
    with pytest.raises(UserError, match="no such file"):
        EditedProject(folder / "other.yaml", lambda: load_project(folder / "other.yaml"))


def test_sounds_follow_the_edits_until_somebody_interrupts(folder, capfd):
    """Targets change, a broken file and one of no solid go by, then the solid changes."""
    path, said = folder / "project.yaml", ""

    def until(text: str, edit: Callable[[], object] | None = None) -> None:
        nonlocal said
        if edit is not None:
            edit()
        begin, deadline = len(said), time.monotonic() + HANG_SECONDS
        while text not in said[begin:]:
            assert time.monotonic() < deadline, said
            time.sleep(0.05)
            said += capfd.readouterr().err

    def visit() -> None:
        try:
            until("design-end.wav, design-side.wav")
            until("going on with the project as it was", lambda: path.write_text("mesh: ["))
            one = small_project.PROJECT["targets"][:1]
            until("going on from the best", lambda: write(folder, targets=one, modes=5))
            until("design-end.wav\n")
            until("no such built-in", lambda: write(folder, mesh="builtin:nothing"))
            until("beginning anew", lambda: write(folder, resolution=12))
            until("design-end.wav, design-side.wav")
        finally:
            os.kill(os.getpid(), signal.SIGINT)

    visitor = threading.Thread(target=visit)
    visitor.start()
    words = ["design", "project.yaml", "--out", "design.h5", "--watch", "--workers", "1"]
    assert main(words) == 0
    visitor.join()
    first, last = read_design("design-before.h5"), read_design("design.h5")
    assert [strike.name for strike in first.strikes] == ["end"]
    assert [strike.name for strike in last.strikes] == ["end", "side"]
    assert len(last.fine_grid) < len(first.fine_grid)
    assert first.history["evaluations"][-1] > 2 and (first.history["cost"] > 0.0).all()
    for name in ("end", "side"):
        sound, rate = soundfile.read(folder / f"design-{name}.wav")
        assert rate == 44_100 and np.abs(sound).max() > 0.01


def test_a_budget_or_the_name_of_a_clip_is_refused(folder, refuses):
    words = ["design", "project.yaml", "--watch", "--out"]
    assert "leave out --seconds" in refuses(main, *words, "design.h5", "--seconds", 5)
    (folder / "end.wav").rename(folder / "design-end.wav")
    targets = copy.deepcopy(small_project.PROJECT["targets"])
    targets[0]["clip"] = "design-end.wav"
    write(folder, targets=targets)
    assert "is an input and would be replaced" in refuses(main, *words, "design.h5")
