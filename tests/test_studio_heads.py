"""Measured heads in the studio, without its page: comparisons, what is kept of them, the blend."""

import io
import json
import os
from contextlib import asynccontextmanager
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import wavfile

from carillon.__main__ import main
from carillon.errors import UserError
from sound.heads.calibration import calibration_of, load_calibration
from sound.heads.head_space import distance, read_heads
from sound.heads.measured_head import read_head
from sound.heads.stimulus import at_ears, noise_bursts
from sound.levels import faded
from sound.synthesis.sinusoids import damped_sinusoids
from studio.binary import pack
from studio.interface import NotFoundError
from studio.processes.heads import FADE_SECONDS, SEED, STRIKE_SECONDS, StruckModes
from studio.session import heads as session_heads
from studio.session import open_studio
from studio.session.document import Document
from studio.session.heads import Heads, strike_of
from studio.session.workspace import Workspace
from tests.synthetic_heads import Anatomy, sphere_directions, write_head

HEADS = {
    "large": Anatomy(radius=0.1, scale=1.15),
    "small": Anatomy(radius=0.075, scale=0.85),
    "usual": Anatomy(),
}
FILE = "people-calibration.json"


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> dict[str, bytes]:
    """Contents of files of heads, by name."""
    folder, directions = tmp_path_factory.mktemp("made"), sphere_directions(step=30.0)
    return {
        f"{name}.sofa": write_head(folder / f"{name}.sofa", anatomy, directions).read_bytes()
        for name, anatomy in HEADS.items()
    }


@pytest.fixture
def folder(tmp_path, made) -> Path:
    """A workspace with a folder of three heads."""
    (tmp_path / "people").mkdir()
    for name, content in made.items():
        (tmp_path / "people" / name).write_bytes(content)
    return tmp_path


@asynccontextmanager
async def opened(folder: Path):
    """The heads of a workspace, and what pages were told of them."""
    workspace = Workspace(folder)
    told: list[dict] = []
    heads = Heads(workspace, lambda: told.append(heads.state()))
    try:
        yield heads, told
    finally:
        heads.end()
        workspace.close()


def samples(content: bytes) -> np.ndarray:
    rate, found = wavfile.read(io.BytesIO(content))
    assert rate == 44_100 and found.shape[1] == 2
    return found.astype(float)


async def test_from_a_folder_to_a_blend_that_the_command_line_writes_too(folder):
    async with opened(folder) as (heads, told):
        heads.look()
        assert told[-1]["folders"] == [{"name": "people", "heads": 3}]
        await heads.open("people")
        assert [each["phase"] for each in told[1:]] == ["reading"] * 4 + ["ready"]
        assert told[2]["message"] == "reading large.sofa" and told[2]["progress"] == 0.0
        assert told[-1]["heads"] == 3 and told[-1]["comparisons"] == 0
        for number, score in enumerate((1, 2, 5, 4, 1)):
            await heads.answer(number, score)
        assert told[-1]["comparisons"] == 5 and told[-1]["direction"] != told[-2]["direction"]
        await heads.write_blend()
        assert told[-1]["blend"] == {"file": "people-blend.sofa", "comparisons": 5}
    expected = calibration_of(read_heads(folder / "people"), SEED)
    for score in (1, 2, 5, 4, 1):
        expected.answer(score)
    assert json.loads((folder / FILE).read_text()) == json.loads(expected.as_json())
    words = ["heads", str(folder / "people"), "--calibration", str(folder / FILE)]
    assert main([*words, "--out", str(folder / "other.sofa")]) == 0
    written, other = (read_head(folder / f"{name}.sofa") for name in ("people-blend", "other"))
    assert distance(written, other) < 1e-6
    for name in ("people-blend", "other"):
        with h5py.File(folder / f"{name}.sofa") as file:
            assert file.attrs["Comment"] == b"preferred after 5 comparisons"


async def test_both_heads_of_a_pair_are_heard_from_its_direction(folder):
    async with opened(folder) as (heads, _):
        await heads.open("people")
        for number in range(3):
            await heads.answer(number, 3)
        # From 60 degrees to the right.
        right = np.array(heads.state()["direction"])
        first, second = [samples(await heads.sound(3, part, None)) for part in "AB"]
        assert right[1] < -0.5 and not np.allclose(first, second)
        for heard in (first, second):
            assert (heard[:, 1] ** 2).sum() > 2.0 * (heard[:, 0] ** 2).sum()
        assert max(np.abs(first).max(), np.abs(second).max()) == pytest.approx(0.5)
        before = samples(await heads.sound(3, "before", None))
        after = samples(await heads.sound(3, "after", None))
        assert before.shape == after.shape and not np.allclose(before, after)
        # As scenes hear by the file of the blend, which is that of all heads alike at first.
        space = read_heads(folder / "people")
        blend = space.blend(np.full(3, 1.0 / 3.0)).equalised()
        expected = at_ears(blend, right, noise_bursts(blend.rate, 3))
        expected *= np.abs(after).max() / np.abs(expected).max()
        np.testing.assert_allclose(after, expected, atol=1e-6)
        with pytest.raises(UserError, match="comparison 2 is not the present one, 3"):
            await heads.sound(2, "A", None)


async def test_a_strike_of_the_solid_is_heard_by_the_heads(folder):
    header = {"event": "bank"}
    modes = {"hertz": ("f8", [440.0, 30_000.0]), "dampings": ("f8", [5.0, 5.0])}
    gains = {"gains": ("f4", [[0.0, 0.1], [0.5, 0.0]]), "struck": ("f8", np.zeros((0, 2)))}
    strike = strike_of(pack(header, modes | gains))
    assert strike.amplitudes.tolist() == [0.5, 0.0]
    struck = strike_of(pack(header, modes | gains | {"struck": ("f8", [[0.2, 0.3]])}))
    assert struck.amplitudes.tolist() == [0.2, 0.3]
    with pytest.raises(UserError, match="no solid sounds yet"):
        strike_of(None)
    async with opened(folder) as (heads, _):
        await heads.open("people")
        heard = samples(await heads.sound(0, "A", strike))
        spectrum = np.abs(np.fft.rfft(heard[:, 0]))
        assert np.argmax(spectrum) * 44_100 / len(heard) == pytest.approx(440.0, abs=2.0)


def test_a_strike_fades_as_other_sounds_do():
    modes = np.array([440.0]), np.array([0.5]), np.array([1.0])
    rate, count = 8_000, round(8_000 * STRIKE_SECONDS)
    ringing = damped_sinusoids(*modes, np.zeros(1), rate, count)
    expected, seconds = faded(ringing, rate, FADE_SECONDS)
    assert seconds == FADE_SECONDS and np.abs(ringing[-80:]).max() > 0.4
    np.testing.assert_array_equal(StruckModes(*modes).samples(rate), expected)


@pytest.mark.parametrize("count", [0, 3, 6])
async def test_a_calibration_goes_on_after_the_studio_was_started_anew(folder, count):
    async with opened(folder) as (heads, _):
        await heads.open("people")
        for number in range(count):
            await heads.answer(number, 1 + number % 5)
        kept = await heads.sound(count, "A", None)
    async with opened(folder) as (heads, told):
        await heads.open("people")
        assert told[-1]["comparisons"] == count
        assert await heads.sound(count, "A", None) == kept
        await heads.answer(count, 2)
    saved = load_calibration(folder / FILE, read_heads(folder / "people"))
    assert saved.count == count + 1


async def test_the_folder_is_that_of_the_last_time(folder):
    for first in (True, False):
        studio = open_studio(None, folder)
        try:
            await studio.start()
            assert studio.state()["heads"]["folder"] == (None if first else "people")
            assert studio.state()["heads"]["phase"] == "none"
            if first:
                await studio.call("open_heads", {"folder": "people"})
                await studio.call("compare_heads", {"number": 0, "score": 4})
                assert len(await studio.head_sound(1, "B", "noise")) > 1000
                with pytest.raises(UserError, match="no solid sounds yet"):
                    await studio.head_sound(1, "B", "strike")
        finally:
            await studio.close()
    assert json.loads((folder / FILE).read_text())["comparisons"][0]["score"] == 4


async def test_a_calibration_is_begun_anew_and_the_former_one_stays(folder):
    async with opened(folder) as (heads, told):
        await heads.open("people")
        await heads.answer(0, 5)
        former = (folder / FILE).read_text()
        await heads.open("people", anew=True)
        assert told[-1]["comparisons"] == 0
        assert (folder / f"{FILE}~").read_text() == former and not (folder / FILE).exists()


async def test_answers_count_once(folder):
    async with opened(folder) as (heads, told):
        with pytest.raises(UserError, match="no heads were read yet"):
            await heads.answer(0, 3)
        await heads.open("people")
        await heads.answer(0, 3)
        with pytest.raises(UserError, match="comparison 0 is not the present one, 1"):
            await heads.answer(0, 3)
        assert told[-1]["comparisons"] == 1


# What cannot be used


async def refused(folder: Path, name: str = "people") -> str:
    """What is said of a folder that fails, in one sentence."""
    async with opened(folder) as (heads, told):
        await heads.open(name)
        assert told[-1]["phase"] == "failed" and "\n" not in told[-1]["message"]
        with pytest.raises(UserError, match="no heads were read yet"):
            await heads.write_blend()
        return told[-1]["message"]


async def test_one_head_is_too_few(folder):
    for name in ("large", "small"):
        (folder / "people" / f"{name}.sofa").unlink()
    said = await refused(folder)
    assert "has 1 measured head, expected at least two" in said and "sofaconventions" in said


async def test_heads_that_are_none_or_alike_are_told(folder, made):
    for name in ("large", "small"):
        (folder / "people" / f"{name}.sofa").write_bytes(made["usual.sofa"])
    assert "nothing to compare" in await refused(folder)
    (folder / "people" / "small.sofa").write_bytes(b"none")
    assert "is not readable as SOFA" in await refused(folder)


async def test_too_many_heads_or_bytes_are_refused_before_they_are_read(folder, monkeypatch):
    monkeypatch.setattr(session_heads, "MOST_HEADS", 2)
    assert "has 3 measured heads" in await refused(folder)
    monkeypatch.setattr(session_heads, "MOST_HEADS", 3)
    monkeypatch.setattr(session_heads, "MOST_BYTES", 1000)
    assert "expected at most 3 of 1,000" in await refused(folder)


async def test_a_calibration_of_other_heads_is_told_and_stays(folder, made):
    async with opened(folder) as (heads, _):
        await heads.open("people")
        await heads.answer(0, 1)
    former = (folder / FILE).read_text()
    (folder / "people" / "more.sofa").write_bytes(made["usual.sofa"])
    assert "is of other heads" in await refused(folder)
    assert (folder / FILE).read_text() == former


@pytest.mark.parametrize("name", ["..", ".", "", "/etc", "people/..", "none", ".studio", "link"])
async def test_folders_that_are_not_listed_are_refused(folder, name, tmp_path_factory, made):
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    for file, content in made.items():
        (elsewhere / file).write_bytes(content)
        (folder / file).write_bytes(content)
        (folder / ".studio").mkdir(exist_ok=True)
        (folder / ".studio" / file).write_bytes(content)
    (folder / "link").symlink_to(elsewhere)
    async with opened(folder) as (heads, told):
        with pytest.raises(NotFoundError):
            await heads.open(name)
        assert heads.folder is None and told == []


async def test_nothing_leads_out_of_the_workspace(folder, tmp_path_factory, made):
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    (elsewhere / "head.sofa").write_bytes(made["usual.sofa"])
    (folder / "people" / "more.sofa").symlink_to(elsewhere / "head.sofa")
    assert "lies outside of the workspace" in await refused(folder)
    (folder / "people" / "more.sofa").unlink()
    precious = elsewhere / "precious"
    precious.write_text("mine")
    (folder / FILE).symlink_to(precious)
    assert "lies outside of the workspace" in await refused(folder)
    (folder / FILE).unlink()
    async with opened(folder) as (heads, _):
        await heads.open("people")
        for name, ask in (
            (FILE, lambda: heads.answer(0, 3)),
            ("people-blend.sofa", heads.write_blend),
        ):
            os.symlink(precious, folder / name)
            with pytest.raises(UserError, match="is a link, expected a file"):
                await ask()
    assert precious.read_text() == "mine"


@pytest.mark.parametrize("said", [7, "", "x" * 300, ["people"]])
def test_a_session_whose_heads_are_none_is_not_gone_on_with(folder, said):
    studio = open_studio(None, folder)
    session = {"name": "pan", "saved": True, "searching": False, "fine": False, "heads": said}
    studio.session.workspace.write_session(session | {"history": {}})
    studio.session.workspace.close()
    studio = open_studio(None, folder)
    assert studio.session.heads.folder is None
    assert studio.session.document == Document({})
    studio.session.workspace.close()
