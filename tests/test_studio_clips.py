"""Clips of a studio: how far the search for their modes is, and how it is stopped."""

import asyncio
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from carillon.errors import UserError
from sound.clips.extraction import FITTING, extract
from sound.synthesis.sinusoids import damped_sinusoids
from studio.interface import NotFoundError
from studio.processes.clips import ClipFile, ClipsBench
from studio.processes.worker import Worker
from studio.session.document import Target
from studio.session.listening import Clips
from tests import small_project
from tests.patience import HANG_SECONDS
from tests.slow_clips import SLOW

TARGETS = [Target("rim", 0, clip="a.wav"), Target("bow", 1, clip="b.wav")]


def opened(folder: Path) -> tuple[Clips, asyncio.Event]:
    """Clips whose search is slow, and what is set at every change."""
    changed = asyncio.Event()
    clips = Clips(lambda name: folder / name, changed.set, changed.set)
    clips._worker = Worker(SLOW)
    return clips, changed


async def until(met: Callable[[], object], changed: asyncio.Event) -> None:
    async with asyncio.timeout(HANG_SECONDS):
        while not met():
            await changed.wait()
            changed.clear()


def phases(clips: Clips) -> list[str]:
    return [each["phase"] for each in clips.state()]


async def test_a_search_for_modes_tells_how_far_it_is_and_is_stopped(tmp_path):
    clips, changed = opened(tmp_path)
    try:
        assert clips.listen(TARGETS) == []
        await until(lambda: clips.state()[0]["progress"] == 0.4, changed)
        assert clips.state()[0]["message"] == "bands of 98 Hz"
        clips.stop("c1")
        assert phases(clips) == ["stopped", "waiting"] and not clips.are_listened_to
        (tmp_path / "b.wav.go").touch()
        clips.listen(TARGETS)
        await until(lambda: phases(clips) == ["stopped", "ready"], changed)
        assert clips.listen(TARGETS) == TARGETS[1:]
        clips.begin_again("c1")
        (tmp_path / "a.wav.go").touch()
        clips.listen(TARGETS)
        await until(lambda: clips.listen(TARGETS) == TARGETS, changed)
        assert [each["message"] for each in clips.state()] == [None, None]
    finally:
        clips.end()


async def test_only_what_goes_on_is_stopped(tmp_path):
    clips, _ = opened(tmp_path)
    clips.add("a.wav")
    with pytest.raises(UserError, match="a.wav: its modes are not being sought"):
        clips.stop("c1")
    with pytest.raises(NotFoundError, match="no clip 'c2'"):
        clips.begin_again("c2")


async def test_a_search_of_before_tells_nothing_any_more(tmp_path):
    clips, changed = opened(tmp_path)
    try:
        clips.listen(TARGETS[:1])
        await until(lambda: clips.state()[0]["progress"] == 0.4, changed)
        clips.stop("c1")
        await asyncio.gather(*clips._tasks)
        assert phases(clips) == ["stopped"]
    finally:
        clips.end()


def test_the_process_tells_what_it_does(tmp_path, monkeypatch):
    monkeypatch.setenv("CARILLON_CACHE", str(tmp_path / "cache"))
    small_project.write_clips(tmp_path, np.array([500.0, 1200.0]))
    told = []
    found = ClipsBench().listen(told.append, ClipFile(str(tmp_path / "end.wav")))
    assert len(found["modes"]) == 2 and 0.9 < found["explained"] <= 1.0
    doing, share = told[0]
    assert doing.startswith("bands of") and 0.0 < share < 1.0
    assert (FITTING, None) in told


def test_progress_is_the_share_of_a_step(tmp_path):
    clip = damped_sinusoids(*np.array([[440.0], [8.0], [0.5], [0.0]]), rate=8000, count=8000)
    told = []
    extract(clip, 8000, progress=lambda doing, share: told.append((doing, share)))
    steps = list(dict.fromkeys(doing for doing, _ in told))
    assert FITTING in steps and len(steps) > 1
    for step in steps:
        shares = [share for doing, share in told if doing == step and share is not None]
        assert shares == sorted(shares)
