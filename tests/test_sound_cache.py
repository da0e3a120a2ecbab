"""Clips that were searched once are not searched again, and nothing else changes."""

import os
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from carillon.errors import UserError
from carillon.files import cache
from sound.clips import files
from sound.clips.extraction import ModalSound, extract
from sound.clips.files import extract_file
from sound.clips.wav import write_wav
from sound.synthesis.sinusoids import damped_sinusoids
from tests.edited_files import edited

RATE = 8000


def written(path: Path, hertz: float = 440.0) -> Path:
    values = (np.array([hertz, 1700.0]), np.array([8.0, 20.0]), np.array([0.5, 0.2]), np.zeros(2))
    write_wav(path, damped_sinusoids(*values, RATE, RATE // 2), RATE)
    return path


@pytest.fixture
def clip(tmp_path):
    return written(tmp_path / "clip.wav")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The cache's folder of clips."""
    monkeypatch.setenv(cache.PLACE, str(tmp_path / "cache"))
    return tmp_path / "cache" / "clips"


@pytest.fixture
def searches(monkeypatch):
    """Clips that are searched, by their first samples."""
    searched = []

    def counted(samples, *rest):
        searched.append(samples[:9].tolist())
        return extract(samples, *rest)

    monkeypatch.setattr(files, "extract", counted)
    return searched


def assert_same(one: ModalSound, other: ModalSound) -> None:
    np.testing.assert_equal(asdict(one), asdict(other))


def test_what_was_found_once_is_found_at_once(clip, folder, searches, tmp_path):
    first = extract_file(clip)
    assert_same(extract_file(clip), first)
    assert_same(extract_file(clip.rename(tmp_path / "other.wav"), visible=True), first)
    assert len(searches) == 1


def test_another_search_is_another_entry(clip, folder, searches, monkeypatch):
    extract_file(clip)
    assert len(extract_file(clip, 1).frequencies) == 1
    extract_file(written(clip, 450.0))
    monkeypatch.setattr(files, "_origin", lambda: b"other code")
    extract_file(clip)
    assert len(searches) == 4 == len(list(folder.iterdir()))


def test_what_cannot_be_used_is_told_every_time(clip, folder, searches):
    for _ in range(2):
        with pytest.raises(UserError, match="clip.wav: 9 modes asked for, more than the 2"):
            extract_file(clip, 9)
    assert len(searches) == 2


@pytest.mark.parametrize("damage", [b"", b"no HDF5", None])
def test_a_damaged_entry_is_made_anew(clip, folder, searches, damage):
    first = extract_file(clip)
    (entry,) = folder.iterdir()
    whole = entry.read_bytes()
    flipped = whole[:2000] + bytes([whole[2000] ^ 1]) + whole[2001:]
    entry.write_bytes(flipped if damage is None else damage)
    for _ in range(2):
        assert_same(extract_file(clip), first)
    assert len(searches) == 2


@pytest.mark.parametrize(
    ("name", "value"), [("frequencies", np.nan), ("frequencies", -1.0), ("dampings", -1.0)]
)
def test_an_entry_that_no_search_finds_is_made_anew(clip, folder, searches, name, value):
    first = extract_file(clip)
    (entry,) = folder.iterdir()
    with edited(entry) as file:
        file[name][0] = value
    assert_same(extract_file(clip), first)
    assert len(searches) == 2


def test_entries_are_found_again_where_files_are_for_a_group(clip, folder, searches):
    before = os.umask(0o002)
    try:
        extract_file(clip)
        extract_file(clip)
    finally:
        os.umask(before)
    assert len(searches) == 1


def test_the_cache_is_for_its_user_alone(clip, folder, searches, monkeypatch):
    extract_file(clip)
    (entry,) = folder.iterdir()
    assert folder.stat().st_mode & 0o777 == 0o700
    extract_file(clip)
    assert len(searches) == 1
    user = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: user + 1)
    extract_file(clip)
    assert len(searches) == 2, "what another user has written was read"


@pytest.mark.parametrize("which", ["folder", "entry"])
def test_what_others_can_write_or_have_linked_is_not_read(clip, folder, searches, which):
    extract_file(clip)
    (entry,) = folder.iterdir()
    place = folder if which == "folder" else entry
    place.chmod(place.stat().st_mode | 0o020)
    extract_file(clip)
    assert len(searches) == 2
    extract_file(clip)
    assert len(searches) == 2, "it is private again"
    place.symlink_to(place.rename(place.with_name("elsewhere")))
    extract_file(clip)
    assert len(searches) == 3


@pytest.mark.parametrize("place", ["/dev/null", "/proc/nowhere", "clip.wav", "x" * 300, "~"])
def test_without_a_cache_clips_are_searched(clip, searches, place, monkeypatch):
    monkeypatch.chdir(clip.parent)
    monkeypatch.setattr(cache, "folder_of", lambda kind: Path(place))
    extract_file(clip)
    extract_file(clip)
    assert len(searches) == 2
    assert [path.name for path in clip.parent.iterdir()] == ["clip.wav"]


def test_entries_used_least_recently_make_room(tmp_path, folder, searches, monkeypatch):
    clips = [written(tmp_path / f"{hertz}.wav", hertz) for hertz in (300.0, 400.0, 500.0)]
    for seconds, clip in enumerate(clips[:2]):
        extract_file(clip)
        for path in folder.iterdir():
            os.utime(path, (seconds, min(seconds, path.stat().st_mtime)))
    size = sum(path.stat().st_size for path in folder.iterdir())
    monkeypatch.setattr(cache, "MOST_BYTES", size)
    extract_file(clips[0])
    extract_file(clips[2])
    assert sum(path.stat().st_size for path in folder.iterdir()) <= size
    extract_file(clips[0])
    assert len(searches) == 3
    extract_file(clips[1])
    assert len(searches) == 4


def test_the_cache_is_the_users_own_unless_told(monkeypatch, tmp_path):
    monkeypatch.delenv(cache.PLACE)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache.folder_of("clips") == tmp_path / "carillon" / "clips"
