"""Regions and supports as a person uses them: a bar of iron and beech, held at its end."""

import numpy as np
import pytest

from sound.project.design_file import read_design
from sound.rendering.solid import SoundingSolid
from studio.session import open_studio
from tests import small_project
from tests.patience import HANG_SECONDS
from tests.studio_pages import TWO_FRAMES, open_page, serving, until
from tests.test_studio_panels import expect
from tests.test_studio_use import BANKS, call, state

pytestmark = pytest.mark.nightly(unless=("studio",))

SETTINGS = {
    "resolution": 16,
    "coarsen": "none",
    "modes": 4,
    "material": {"dimensions": 10},
    "optimiser": {"seconds": None, "evaluations": 30, "workers": 1},
}
FREQUENCIES = np.array([60.0, 160.0, 420.0, 700.0])


def until_so(page, expression) -> None:
    until(lambda: page.evaluate(expression), HANG_SECONDS)


def end_of(page) -> dict[str, float]:
    """Pixels of a vertex that is seen, farthest to the right."""
    found = page.evaluate(
        """() => {
          const { view } = studio;
          let best = null;
          for (let vertex = 0; vertex < view.drawing.surface.positions.length / 3; vertex++) {
            const at = view.project(vertex);
            const inside = [[-4, 0], [4, 0], [0, -4], [0, 4]].every(
              ([x, y]) => view.pick(at.x + x, at.y + y) !== null);
            if (at.hidden || !inside || (best && best.x > at.x)) continue;
            best = at;
          }
          return best;
        }"""
    )
    assert found
    return found


def draw(page, start, stop) -> None:
    page.mouse.move(*start)
    page.mouse.down()
    page.mouse.move(*stop, steps=6)
    page.evaluate(TWO_FRAMES)
    page.mouse.up()


def test_a_bar_of_iron_and_beech_is_painted_held_and_designed(browser, tmp_path, monkeypatch):
    monkeypatch.setenv("CARILLON_CACHE", str(tmp_path / "cache"))
    small_project.write_clips(tmp_path, FREQUENCIES)
    studio = open_studio("builtin:bar", tmp_path)
    with serving(studio) as address:
        page = open_page(browser, address, ready="studio.state?.current && studio.view.shown")
        page.evaluate(BANKS)
        call(page, "change_settings", settings=SETTINGS)
        regions, supports = page.locator("#panel-regions"), page.locator("#panel-supports")
        regions.get_by_role("button", name="Add a region").click()
        until_so(page, "studio.selection.current.row?.number === 0")
        regions.get_by_label("Material").select_option("iron")
        until_so(page, "studio.state.current.regions[0].material === 'iron'")
        regions.get_by_role("button", name="Add a region").click()
        until_so(page, "studio.selection.current.tool === 'paint'")
        end = end_of(page)
        page.evaluate("studio.selection.set({ brush: 0.15 })")
        draw(page, (end["x"] - 60, end["y"] + 10), (end["x"], end["y"]))
        until_so(page, "studio.state.current.regions[1].dabs > 0")
        regions.get_by_label("Material").select_option("beech")
        until_so(page, "studio.state.current.regions[1].material === 'beech'")
        supports.get_by_role("button", name="Paint what is held").click()
        until_so(page, "studio.selection.current.row?.kind === 'supports'")
        until_so(page, "studio.selection.current.tool === 'paint'")
        page.mouse.click(end["x"], end["y"])
        until_so(page, "studio.state.current.supports[0].dabs > 0")
        until_so(page, "window.banks.at(-1)?.rigid_motions === 0")
        expect(page.locator("#panel-spectrum")).to_contain_text("Held: no rigid motion is left")
        clip = tmp_path / "end.wav"
        identifier = page.evaluate(
            """async (content) => studio.connection.upload("clip", "end.wav",
                 new Blob([Uint8Array.from(content)]))""",
            list(clip.read_bytes()),
        )
        call(page, "add_target", vertex=0, name="end", clip=identifier)
        until_so(page, "studio.state.current.wanted && studio.view.settled")
        call(page, "optimise")
        until_so(page, "studio.state.current.search.phase === 'running'")
        until_so(page, "studio.state.current.search.phase === 'idle'")
        until_so(page, "studio.state.current.solid.phase === 'ready'")
        call(page, "save", name="bar")
        assert state(page)["saved"]
        hertz = page.evaluate("Array.from(window.arrays.hertz)")
        assert page.faults == []
    design = read_design(tmp_path / "bar.h5")
    assert design.model.rigid_modes == 0
    assert set(design.model.regions.names) >= {"body", "region 2"}
    sounding = SoundingSolid.of_design(design)
    assert np.allclose(sorted(sounding.frequencies), hertz, rtol=1e-9)
