"""The studio without its page: from a solid to a design, edits while it is sought, and ends."""

import asyncio
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil
import pytest
import yaml

from carillon.errors import UserError
from sound.project.design_file import read_design
from sound.project.project import load_project
from sound.rendering.listening import Listening
from sound.rendering.solid import SoundingSolid
from studio.binary import unpack
from studio.session import open_studio
from studio.session.document import Material
from studio.session.workspace import OWN_FOLDER
from tests import small_project
from tests.patience import HANG_SECONDS, wait_for

FREQUENCIES = np.array([500.0, 1200.0, 1900.0, 2600.0, 3300.0, 4100.0])
BAR = {key: small_project.PROJECT[key] for key in ("mesh", "resolution", "coarsen", "material")}


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """A workspace with a project of a bar and its clips."""
    small_project.write_clips(tmp_path, FREQUENCIES)
    content = small_project.PROJECT | {"optimiser": {"seconds": None, "evaluations": 60}}
    (tmp_path / "bar.yaml").write_text(yaml.safe_dump(content))
    monkeypatch.setenv("CARILLON_CACHE", str(tmp_path / "cache"))
    return tmp_path


class Page:
    """What a page would know: the last of each event."""

    def __init__(self, feed) -> None:
        self.feed, self.last, self.said = feed, {}, []
        self.banks = 0

    async def listen(self) -> None:
        while (message := await self.feed.next()) is not None:
            if isinstance(message, bytes):
                self.last["bank"] = unpack(message)
                self.banks += 1
                continue
            event = json.loads(message)
            self.last[event["event"]] = event
            if event["event"] == "said":
                self.said.append(event["text"])

    @property
    def state(self):
        return self.last["state"]

    @property
    def bank(self):
        return self.last["bank"]

    @property
    def is_idle(self) -> bool:
        """Whether everything is ready, and what is heard is of the present targets."""
        solid = self.state["solid"] or {}
        return (
            solid.get("phase") == "ready"
            and self.state["search"]["phase"] == "idle"
            and "bank" in self.last
            and self.bank[0]["surface"] == solid["surface"]
        )


@asynccontextmanager
async def opened(folder: Path, what: str | None = None):
    """A studio and its page."""
    studio = open_studio(what, folder)
    try:
        await studio.start()
        page = Page(studio.subscribe())
        listening = asyncio.ensure_future(page.listen())
        await asyncio.sleep(0.05)
        yield studio, page
    finally:
        await studio.close()
    await listening


@asynccontextmanager
async def opened_bar(folder: Path):
    """A studio with the project of the bar, which sounds, and its page."""
    async with opened(folder, str(folder / "bar.yaml")) as (studio, page):
        await until(lambda: aimed(page, ["end", "side"]), page)
        yield studio, page


async def until(met: Callable[[], object], page: Page) -> None:
    try:
        async with asyncio.timeout(HANG_SECONDS):
            while not met():
                await asyncio.sleep(0.02)
    except TimeoutError:
        pytest.fail(f"no end: {page.state['solid']}, said: {page.said}")
    assert page.last


def aimed(page: Page, names: list[str]) -> bool:
    return page.is_idle and page.bank[0]["targets"] == names


def partials_of(page: Page) -> int:
    """Number of modes that clips ask for, silent ones aside."""
    return sum(hertz is not None for hertz in page.bank[0]["wanted_hertz"])


def settled(studio, page: Page) -> bool:
    """Whether no search is wanted any more, and the page has what the design sounds like."""
    told = studio.reconciler.is_settled and not page.feed._waiting
    return told and page.is_idle and not studio.session.is_searching


def is_alive(process: psutil.Process) -> bool:
    try:
        return process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def cost(page: Page) -> float:
    return page.bank[0]["cost"]


async def test_a_solid_alone_can_be_struck(folder):
    async with opened(folder) as (studio, page):
        assert page.state["solid"] is None
        await studio.call("open_mesh", {"mesh": "builtin:box"})
        await until(lambda: page.is_idle, page)
        header, arrays = page.bank
        surface, parts = unpack(await studio.surface(header["surface"]))
        count = page.state["solid"]["vertices"]
        assert parts["positions"].shape == (count, 3) == parts["inward"].shape
        assert arrays["gains"].shape == (count, len(arrays["hertz"]))
        assert np.isclose(arrays["gains"].sum(axis=1).max(), 0.5)
        assert (np.diff(arrays["hertz"]) >= 0).all() and np.allclose(arrays["young"], 1e9)
        with pytest.raises(UserError, match="no target has a clip"):
            await studio.call("optimise", {})


async def test_from_a_project_to_a_design_that_the_command_line_goes_on_with(folder):
    async with opened_bar(folder) as (studio, page):
        assert page.state["saved"] and page.state["name"] == "bar"
        before = cost(page)
        await studio.call("optimise", {})
        await until(lambda: settled(studio, page), page)
        assert cost(page) < 0.9 * before
        header, arrays = page.bank
        assert not page.state["saved"]
        with pytest.raises(UserError, match="letters, digits"):
            await studio.call("save", {"name": "../bar"})
        await studio.call("save", {"name": "found"})
        await until(lambda: page.state["saved"], page)
        assert page.state["name"] == "found"
    design = read_design(folder / "found.h5")
    assert load_project(folder / "found.yaml").targets[0].name == "end"
    solid = SoundingSolid.of_design(design)
    assert np.allclose(arrays["hertz"], solid.frequencies, rtol=1e-12)
    assert np.allclose(arrays["dampings"], solid.dampings, rtol=1e-12)
    strike = design.strikes[0]
    gain = Listening.of_design(design, solid).gain(strike.position)
    amplitudes = gain * solid.amplitudes(strike.position[None], strike.inward[None])[0]
    assert np.allclose(arrays["gains"][strike.vertex], amplitudes, rtol=1e-6)
    assert np.allclose(arrays["struck"][0], amplitudes, rtol=1e-9)
    assert np.isclose(header["cost"], design.evidence["cost"])
    command = [sys.executable, "-m", "carillon", "design", "found.yaml", "--out", "found.h5"]
    before = read_design(folder / "found.h5")
    subprocess.run([*command, "--evaluations", "20"], cwd=folder, check=True)
    assert read_design(folder / "found.h5").evidence["cost"] <= 1.01 * before.evidence["cost"]


async def test_an_edit_while_a_search_goes_on_is_taken_up_and_can_be_undone(folder):
    async with opened_bar(folder) as (studio, page):
        await studio.call("change_settings", {"settings": {"optimiser": {"evaluations": None}}})
        await studio.call("optimise", {})
        await until(lambda: studio.session.document.material is not None, page)
        await studio.call("remove_target", {"target": "side"})
        kept = studio.session.document.material
        assert kept is not None
        await until(lambda: page.bank[0]["targets"] == ["end"], page)
        await until(lambda: page.state["search"]["phase"] == "running", page)
        await until(lambda: studio.session.document.material != kept, page)
        await studio.call("stop", {})
        await until(lambda: studio.session.document.material.design is not None, page)
        await until(lambda: settled(studio, page), page)
        assert page.state["undo"] == "remove target side"
        assert studio.session.document.material.design is not None
        for names in (["end", "side"], ["end", "side"]):
            await studio.call("undo", {})
            assert [each["name"] for each in studio.state()["targets"]] == names
        assert studio.session.document.material is None
        await until(lambda: aimed(page, ["end", "side"]), page)
        for _ in range(2):
            await studio.call("redo", {})
        await until(lambda: aimed(page, ["end"]), page)
        assert studio.session.document.material.design is not None
        assert not page.said


async def test_a_stopped_search_keeps_what_was_checked_if_that_is_better(folder):
    """As the last material was found on the coarse solid alone."""
    worse, better = Material((3.0, *[0.0] * 9)), [0.0] * 10
    async with opened_bar(folder) as (studio, page):
        session = studio.session
        for found, kept in ((None, worse.z), (worse, better)):
            session.history.replace(replace(session.document, material=worse))
            session.search.found, session.search.best_checked = found, better
            await studio.call("save", {"name": "kept"})
            design = read_design(folder / "kept.h5")
            assert design.coordinates.tolist() == list(kept)
            assert session.document.material.z == tuple(kept)
        assert page.state["saved"]


async def test_targets_are_placed_moved_named_and_given_clips(folder):
    async with opened(folder) as (studio, page):
        await studio.call("open_mesh", {"mesh": "builtin:bar"})
        await studio.call("change_settings", {"settings": {"resolution": 16}})
        await until(lambda: page.is_idle, page)
        await studio.call("add_target", {"vertex": 5})
        await studio.call("add_target", {"vertex": 7, "name": "b"})
        with pytest.raises(UserError, match="at this point"):
            await studio.call("add_target", {"vertex": 5})
        with pytest.raises(UserError, match="no vertex 1000000"):
            await studio.call("add_target", {"vertex": 10**6})
        with pytest.raises(UserError, match="another name"):
            await studio.call("change_target", {"target": "b", "name": "target 1"})
        clip = await studio.take_clip("end.wav", (folder / "end.wav").read_bytes())
        await studio.call("change_target", {"target": "b", "clip": clip, "vertex": 9})
        await until(lambda: aimed(page, ["b"]), page)
        assert partials_of(page) == len(FREQUENCIES)
        without = [float(studio.state()["clips"][0]["modes"][0]["hertz"])]
        await studio.call("change_target", {"target": "b", "without": without})
        await until(lambda: partials_of(page) == len(FREQUENCIES) - 1, page)
        for part in ("sound", "modes", "rest", "noise"):
            assert (await studio.clip_sound(clip, part))[:4] == b"RIFF"
        spectrum = await studio.clip_spectrum(clip)
        assert max(spectrum["decibels"]) == 0.0


async def test_what_cannot_be_used_is_told_and_the_solid_still_sounds(folder):
    async with opened(folder) as (studio, page):
        identifier = await studio.take_mesh("bad.obj", b"no mesh at all")
        await studio.call("open_mesh", {"mesh": identifier})
        await until(lambda: (page.state["solid"] or {}).get("phase") == "failed", page)
        assert "bad.obj" in page.state["solid"]["message"]
        await studio.call("open_mesh", {"mesh": "builtin:bar"})
        await until(lambda: page.is_idle, page)
        clip = await studio.take_clip("bad.wav", b"no sound at all")
        await studio.call("add_target", {"vertex": 5, "clip": clip})
        await until(lambda: studio.state()["clips"][0]["phase"] == "failed", page)
        assert "bad.wav" in studio.state()["clips"][0]["message"]
        await until(lambda: page.is_idle, page)
        for name, wrong in (
            ("change_settings", {"settings": {"resolution": "many"}}),
            ("change_settings", {"settings": {"mesh": "/etc/passwd"}}),
            ("open_mesh", {"mesh": "/etc/passwd"}),
            ("open_project", {"project": "p99"}),
            ("change_target", {"target": "nobody", "name": "a"}),
            ("swap", {}),
        ):
            with pytest.raises(UserError) as caught:
                await studio.call(name, wrong)
            assert "\n" not in str(caught.value)


def test_a_project_that_names_files_elsewhere_is_refused(folder):
    described = yaml.safe_load((folder / "bar.yaml").read_text())
    described["targets"][0]["clip"] = "../end.wav"
    (folder / "inner").mkdir()
    path = folder / "inner" / "bar.yaml"
    path.write_text(yaml.safe_dump(described))
    with pytest.raises(UserError, match="outside of the workspace"):
        open_studio(str(path), path.parent)


@pytest.mark.parametrize("forest", ["/etc/passwd", "../forest.h5"])
async def test_settings_that_name_files_elsewhere_are_refused(folder, forest):
    async with opened(folder) as (studio, _):
        with pytest.raises(UserError, match="outside of the workspace"):
            await studio.call("change_settings", {"settings": {"forest": forest}})


@pytest.mark.nightly
async def test_settings_of_other_voxels_begin_anew_and_those_of_a_search_do_not(folder):
    async with opened_bar(folder) as (studio, page):
        await studio.call("optimise", {})
        await until(lambda: studio.session.document.material is not None, page)
        await until(lambda: settled(studio, page), page)
        await studio.call("change_settings", {"settings": {"weights": {"amplitude": 5.0}}})
        assert studio.session.document.material is not None
        await studio.call("change_settings", {"settings": {"resolution": 12}})
        assert studio.session.document.material is None
        await studio.call("undo", {})
        assert studio.session.document.material is not None


@pytest.mark.nightly
async def test_materials_are_kept_and_swapped(folder):
    async with opened_bar(folder) as (studio, page):
        await studio.call("optimise", {})
        await until(lambda: studio.session.document.material is not None, page)
        await until(lambda: settled(studio, page), page)
        found = studio.session.document.material
        await studio.call("keep", {})
        await studio.call("forget_material", {})
        for heard, now, other in (("B", None, found), ("A", found, None), ("B", None, found)):
            assert studio.state()["heard"] == heard
            assert (studio.session.document.material, studio.session.document.kept) == (
                now,
                other,
            )
            await studio.call("swap", {})
        await studio.call("change_settings", {"settings": {"resolution": 12}})
        with pytest.raises(UserError, match="no material is kept"):
            await studio.call("swap", {})


async def test_a_studio_ends_while_a_search_is_about_to_begin(folder, monkeypatch):
    async with asyncio.timeout(HANG_SECONDS / 4), opened_bar(folder) as (studio, page):
        budget = {"optimiser": {"evaluations": None, "seconds": None}}
        await studio.call("change_settings", {"settings": budget})
        ask, asked = studio.session.solid.ask, asyncio.Event()

        async def slowly(name, *arguments):
            if name == "problem":
                asked.set()
                await asyncio.sleep(0.5)
            return await ask(name, *arguments)

        monkeypatch.setattr(studio.session.solid, "ask", slowly)
        await studio.call("optimise", {})
        await asked.wait()


@pytest.mark.nightly
async def test_nothing_is_lost_when_all_is_killed_in_a_search(folder):
    """The server ends at once with its processes; started again, it goes on from there."""
    command = [sys.executable, "-m", "carillon", "studio", "bar.yaml", "--no-browser"]
    content = yaml.safe_load((folder / "bar.yaml").read_text())
    content["optimiser"] = {"seconds": None}
    (folder / "bar.yaml").write_text(yaml.safe_dump(content))
    async with opened_bar(folder) as (studio, page):
        await studio.call("optimise", {})
    session = folder / OWN_FOLDER / "session.json"
    served = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True)
    try:
        wait_for(
            lambda: json.loads(session.read_text())["history"]["document"]["material"],
            "a material that is saved",
            served,
        )
        children = psutil.Process(served.pid).children(recursive=True)
        assert len(children) >= 3
    finally:
        os.kill(served.pid, signal.SIGKILL)
        served.wait()
    wait_for(lambda: not any(map(is_alive, children)), "processes to end")
    saved = json.loads(session.read_text())["history"]["document"]["material"]["z"]
    async with opened(folder) as (studio, page):
        assert list(studio.session.document.material.z) == saved
        await until(lambda: page.state["search"]["phase"] == "running", page)
        await studio.call("stop", {})
        await until(lambda: studio.session.document.material.design is not None, page)
        await until(lambda: settled(studio, page), page)
        assert studio.session.document.material.design is not None


@pytest.mark.nightly
async def test_an_example_opens_and_leaves_its_clips_in_the_workspace(folder):
    async with opened(folder) as (studio, page):
        await studio.call("open_project", {"project": "e1"})
        await until(lambda: page.is_idle and page.bank[0]["targets"], page)
        assert page.state["targets"][0]["clip"] is not None
        document = studio.session.document
        assert document.project(folder).targets[0].clip.endswith(".wav")
        assert replace(document, targets=()).mesh == document.mesh
