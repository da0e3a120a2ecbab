"""The studio as a person uses it, in a browser: from an empty page to a design that is saved."""

import base64
import io

import numpy as np
import pytest
from PIL import Image

from sound.clips.wav import write_wav
from sound.project.design_file import read_design
from sound.project.project import load_project, project_of
from tests import small_project
from tests.patience import HANG_SECONDS
from tests.small_project import RATE
from tests.studio_load import real_studio
from tests.studio_pages import open_page, until
from tests.test_studio_sound import PACKED, RENDER, measured

DAMPING, SECONDS = 20.0, 0.5
"""Of the clips that the solid is to sound like."""
SETTINGS = {
    "resolution": 16,
    "coarsen": "none",
    "modes": 6,
    "material": {"dimensions": 10},
    "optimiser": {"seconds": None, "evaluations": None, "workers": 1},
}
NAMES = ("end", "side")
BANKS = """() => {
  window.banks = [];
  studio.connection.onBinary("bank", (header, arrays) => {
    window.banks.push(header);
    window.arrays = arrays;
  });
}"""
"""Keeps what the page is told of the solid's sound."""


def call(page, name, /, **arguments) -> None:
    """Ask the studio as the page does."""
    page.evaluate("([name, given]) => studio.connection.call(name, given)", [name, arguments])


def state(page):
    return page.evaluate("studio.state.current")


def until_so(page, expression) -> None:
    until(lambda: page.evaluate(expression), HANG_SECONDS)


def seen(page, count) -> list[tuple[int, float, float]]:
    """Vertices far from each other that the camera sees, with their pixels."""
    found = page.evaluate(
        """() => {
          const { view } = studio, found = [];
          const total = view.drawing.surface.positions.length / 3;
          for (let vertex = 0; vertex < total; vertex++) {
            const at = view.project(vertex);
            if (!at || at.hidden || view.pick(at.x, at.y) !== vertex) continue;
            // At the outline a hair's breadth decides whether the solid is met.
            const around = [[-3, 0], [3, 0], [0, -3], [0, 3]];
            if (around.some(([x, y]) => view.pick(at.x + x, at.y + y) === null)) continue;
            if (document.elementFromPoint(at.x, at.y) === view.drawing.canvas)
              found.push([vertex, at.x, at.y]);
          }
          return found;
        }"""
    )
    places = np.array(found)
    chosen = [int(np.argmin(places[:, 1]))]
    while len(chosen) < count:
        apart = np.linalg.norm(places[:, None, 1:] - places[None, chosen, 1:], axis=2)
        chosen.append(int(np.argmax(apart.min(axis=1))))
    return [(int(vertex), x, y) for vertex, x, y in places[chosen]]


def write_clips(folder, vertices) -> None:
    """Clips of the bar with another material, struck at two of its vertices."""
    (folder / "none.wav").touch()
    targets = [
        {"name": name, "vertex": vertex, "clip": "none.wav"}
        for name, vertex in zip(NAMES, vertices)
    ]
    wanted = small_project.targets(project_of(small_project.PROJECT | {"targets": targets}, folder))
    (folder / "none.wav").unlink()
    t = np.arange(SECONDS * RATE) / RATE
    modes = np.exp(-DAMPING * t) * np.sin(2 * np.pi * np.outer(wanted.frequencies, t))
    for name, amplitudes in zip(NAMES, wanted.amplitudes):
        write_wav(folder / f"{name}.wav", amplitudes @ modes, RATE, peak=True)


def picture(page) -> np.ndarray:
    content = page.locator("#view canvas").screenshot()
    return np.asarray(Image.open(io.BytesIO(content)).convert("RGB"), float)


@pytest.mark.nightly
def test_from_an_empty_page_to_a_design(browser, tmp_path):
    """Two clips, a third target in the midst of the search, undo, saved and opened again."""
    work, clips = tmp_path / "work", tmp_path / "clips"
    work.mkdir()
    clips.mkdir()
    with real_studio(work) as address:
        page = open_page(browser, address, "studio.state?.current")
        page.evaluate(PACKED)
        page.evaluate(BANKS)
        page.get_by_role("button", name="bar", exact=True).click()
        until_so(page, "studio.state.current.solid?.phase === 'ready' && studio.view.settled")
        call(page, "change_settings", settings=SETTINGS)
        until_so(page, "studio.state.current.solid.phase === 'ready' && studio.view.settled")
        places = seen(page, 4)
        write_clips(clips, [vertex for vertex, *_ in places[:2]])

        page.get_by_text("Place target").click()
        for name, (vertex, x, y) in zip(NAMES, places):
            page.evaluate("studio.selection.set({ target: null })")
            page.mouse.click(x, y)
            until_so(page, f"studio.state.current.targets.some((t) => t.vertex === {vertex})")
            target = next(t for t in state(page)["targets"] if t["vertex"] == vertex)
            page.evaluate("(target) => studio.selection.set({ target })", target["name"])
            page.locator("#panel-targets input[type=file]").set_input_files(clips / f"{name}.wav")
            until_so(page, f"studio.state.current.clips.some((c) => c.name === '{name}.wav')")
        until_so(page, "studio.state.current.wanted?.amplitudes.length === 2")
        until_so(page, "studio.view.settled")
        until_so(page, "window.banks.at(-1)?.targets.length === 2")
        first, plain = page.evaluate("window.banks.at(-1).cost"), picture(page)
        page.get_by_role("button", name="Optimise", exact=True).click()
        until_so(page, "studio.state.current.search.phase === 'running'")

        vertex, x, y = places[2]
        page.evaluate("studio.selection.set({ target: null })")
        page.mouse.click(x, y)
        until_so(page, "studio.state.current.targets.length === 3")
        assert state(page)["search"]["phase"] != "idle"
        page.get_by_text("Undo", exact=True).click()
        until_so(page, "studio.state.current.targets.length === 2")

        page.get_by_role("button", name="Optimise", exact=True).click()
        until_so(page, f"window.banks.at(-1).cost < 0.2 * {first}")
        page.locator("#panel-project").get_by_role("button", name="Stop").click()
        until_so(page, "studio.state.current.search.phase === 'idle'")
        call(page, "save", name="found")
        until_so(page, "studio.state.current.saved && studio.state.current.name === 'found'")
        until_so(page, "studio.view.settled")
        assert np.abs(picture(page) - plain).mean() > 1.0

        design = read_design(work / "found.h5")
        assert design.evidence["cost"] < 0.2 * first
        struck = places[3]
        page.get_by_text("Strike", exact=True).first.click()
        page.mouse.click(struck[1], struck[2])
        assert page.evaluate("window.strikes.at(-1)") == [struck[0], 1]
        sound = page.evaluate(
            """async (vertex) => {
              const { hertz, dampings, gains } = window.arrays;
              const own = gains.subarray(vertex * hertz.length, (vertex + 1) * hertz.length);
              const strike = { do: "strike", gains: [...own], at_seconds: 0, contact_seconds: 0 };
              const render = RENDER;
              return render({ hertz: [...hertz], dampings: [...dampings], messages: [strike],
                              seconds: 0.6, rate: 44100 });
            }""".replace("RENDER", RENDER),
            struck[0],
        )
        heard = np.frombuffer(base64.b64decode(sound), "<f4").astype(float)
        gains = page.evaluate(
            "(v) => [...window.arrays.gains.subarray(v * window.arrays.hertz.length, "
            "(v + 1) * window.arrays.hertz.length)]",
            struck[0],
        )
        frequency = design.frequencies[int(np.argmax(gains))]
        assert abs(1200 * np.log2(measured(heard, frequency, 44_100) / frequency)) < 1.0
        assert page.faults == []
        page.context.close()
    names = [target.clip.rsplit("/", 1)[1] for target in load_project(work / "found.yaml").targets]
    assert names == ["end.wav", "side.wav"]

    with real_studio(work, str(work / "found.yaml")) as address:
        page = open_page(browser, address, "studio.state?.current")
        until_so(page, "studio.view.settled && studio.state.current.wanted !== null")
        again = state(page)
        assert [target["vertex"] for target in again["targets"]] == [v for v, *_ in places[:2]]
        assert (again["name"], again["saved"]) == ("found", True)
        until_so(page, "studio.view.material?.young?.length > 0")
        young = page.evaluate("[...studio.view.material.young]")
        assert np.ptp(young) > 0.0
        assert np.log(young).std() == pytest.approx(np.log(design.young).std(), rel=0.5)
        page.context.close()
