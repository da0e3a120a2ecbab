"""The studio's panels in a real browser: what they show of a state, and what they ask for."""

import re
import time
from pathlib import Path

import numpy as np
import pytest
import yaml
from jsonschema import Draft202012Validator

from carillon.composition.materials import named_material
from carillon.parameters.schema import schema_of
from sound.design.pitch import bark as bark_of
from sound.design.pitch import cents as cents_of
from sound.project.project import Project
from studio.server.uploads import CLIP_ENDINGS
from tests.panels_page import NOW, WANTED, bank, progress, ready_clip, state, target, window
from tests.patience import PATIENCE_SECONDS
from tests.studio_pages import TWO_FRAMES, axe_finds

pytestmark = pytest.mark.nightly(unless=("studio",))

INK = """(place) => {
  const canvas = document.querySelector(place + " canvas");
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  const found = { green: 0, red: 0, all: 0, sum: 0 };
  for (let k = 0; k < data.length; k += 4) {
    const [r, g, b, a] = data.subarray(k, k + 4);
    if (a < 128) continue;
    found.all += 1;
    found.sum = (found.sum * 31 + k + r + g + b) % 1000000007;
    if (g > r + 40 && g > b + 40) found.green += 1;
    if (r > g + 60 && r > b + 60) found.red += 1;
  }
  return found;
}"""
"""What is drawn in a plot: pixels by colour, and a sum that differs where any pixel does."""


@pytest.fixture(scope="module")
def wide(browser):
    """A window of a desktop."""
    with window(browser) as wide:
        yield wide


@pytest.fixture
def panels(wide):
    """The page with a bell, a target that has a clip and one that has none."""
    wide.open()
    yield wide
    assert wide.faults == []


@pytest.fixture
def page(panels):
    return panels.page


def until(panels, holds) -> None:
    """Wait until something holds, while the page goes on."""
    end = time.monotonic() + PATIENCE_SECONDS
    while not holds():
        assert time.monotonic() < end, f"calls so far: {panels.calls}"
        panels.page.wait_for_timeout(20)


def last_call(panels, count: int = 1):
    until(panels, lambda: len(panels.calls) >= count)
    return panels.calls[-1]


def expect(locator):
    from playwright.sync_api import expect

    return expect(locator, "the page")


def ink(panels, place: str) -> dict[str, int]:
    # Plots are drawn in the next frame.
    panels.page.evaluate(TWO_FRAMES)
    return panels.page.evaluate(INK, place)


# Targets


def test_targets_are_listed_with_their_clips(page):
    rows = page.locator(".target-list > li")
    expect(rows).to_have_text(["rimplate.wav, 4 modes", "handleno clip"])
    expect(page.get_by_label("Name").first).to_have_value("pan")
    expect(page.locator("#target-name")).to_have_value("rim")


def test_the_arrow_keys_choose_a_target(page):
    page.locator(".target-list input").first.focus()
    page.keyboard.press("ArrowDown")
    expect(page.locator("#target-name")).to_have_value("handle")
    assert page.evaluate("studio.selection.current.target") == "handle"
    expect(page.locator("#panel-clip")).to_contain_text("handle has no clip yet")


def test_a_target_is_renamed_moved_and_removed(panels, page):
    page.fill("#target-name", "bell's rim")
    page.keyboard.press("Enter")
    assert last_call(panels) == ("change_target", {"target": "rim", "name": "bell's rim"})
    move = page.get_by_role("button", name="Move to the point struck last")
    expect(move).to_be_disabled()
    page.evaluate("studio.selection.set({ vertex: 0 })")
    move.click()
    assert last_call(panels, 2) == ("change_target", {"target": "rim", "vertex": 0})
    page.get_by_role("button", name="Remove").click()
    assert last_call(panels, 3) == ("remove_target", {"target": "rim"})


def test_a_name_that_is_refused_goes_back(panels, page):
    panels.refused["change_target"] = "There is a target handle already; choose another name."
    page.fill("#target-name", "handle")
    page.keyboard.press("Enter")
    expect(page.locator(".message.error")).to_contain_text("There is a target handle")
    expect(page.locator("#target-name")).to_have_value("rim")


def test_the_point_struck_last_becomes_a_target(panels, page):
    add = page.get_by_role("button", name="Add the point struck last")
    expect(add).to_be_disabled()
    page.evaluate("studio.selection.set({ vertex: 2 })")
    add.click()
    assert last_call(panels) == ("add_target", {"vertex": 2})


def test_every_part_of_a_clip_can_be_heard_and_the_solid(panels):
    group = panels.page.get_by_role("group", name="Listen")
    for name in ("Clip", "Modes", "Rest", "Noise", "Solid"):
        group.get_by_role("button", name=name).click()
    parts = [["play", f"/clip/c1/{part}"] for part in ("sound", "modes", "rest", "noise")]
    assert panels.heard() == [*parts, ["strike", 1, 1]]


def test_of_a_clip_that_is_being_listened_to_only_the_clip_is_heard(panels, page):
    clip = ready_clip() | {"phase": "listening", "modes": []}
    panels.open(state(clips=[clip], wanted=None))
    group = page.get_by_role("group", name="Listen")
    expect(group.get_by_role("button", name="Clip")).to_be_enabled()
    expect(group.get_by_role("button", name="Modes")).to_be_disabled()
    expect(page.locator("#panel-clip")).to_contain_text("being found")
    expect(page.locator("#search-state")).to_contain_text("handle does not count")


def test_a_clip_is_chosen_taken_from_a_file_and_recorded(panels, page):
    page.select_option("#target-clip", "")
    assert last_call(panels) == ("change_target", {"target": "rim", "clip": None})
    panels.change(targets=[target("rim", 1, None)])
    sound = {"name": "a b.wav", "mimeType": "audio/wav", "buffer": b"RIFF"}
    page.set_input_files("#target-file", sound)
    assert last_call(panels, 2) == ("change_target", {"target": "rim", "clip": "c10"})
    page.click("#record-clip")
    expect(page.locator(".recording")).to_contain_text("7.5 s left")
    assert page.locator(".recording meter").evaluate("each => each.value") == pytest.approx(
        -6.02, abs=0.01
    )
    # Whoever records by keyboard is where it ends.
    expect(page.get_by_role("button", name="Stop and keep")).to_be_focused()
    page.keyboard.press("Enter")
    assert last_call(panels, 3) == ("change_target", {"target": "rim", "clip": "c11"})
    assert panels.uploads == ["a b.wav", "recording-1.wav"]
    expect(page.locator("#record-clip")).to_be_focused()


def test_a_recording_is_discarded_or_ends_by_itself(panels, page):
    page.click("#record-clip")
    page.get_by_role("button", name="Discard", exact=True).first.click()
    expect(page.locator(".recording")).to_be_hidden()
    assert panels.heard() == [["cancel"]] and panels.uploads == []
    page.click("#record-clip")
    expect(page.locator(".recording")).to_be_visible()
    page.evaluate("studio.recorder.fill()")
    page.get_by_role("button", name="Replace by recording-1.wav").click()
    assert last_call(panels) == ("change_target", {"target": "rim", "clip": "c10"})


def test_a_clip_replaces_another_one_only_after_a_question(panels, page):
    sound = {"name": "cup.flac", "mimeType": "audio/flac", "buffer": b"fLaC"}
    page.set_input_files("#target-file", sound)
    question = page.get_by_role("dialog")
    expect(question).to_have_accessible_name("rim has the clip plate.wav. Replace it by cup.flac?")
    question.get_by_role("button", name="Keep plate.wav").click()
    expect(question).to_have_count(0)
    assert panels.calls == [] and panels.uploads == ["cup.flac"]
    panels.change(clips=[ready_clip(), ready_clip() | {"clip": "c10", "name": "cup.flac"}])
    page.select_option("#target-clip", "c10")
    page.keyboard.press("Escape")
    expect(question).to_have_count(0)
    expect(page.locator("#target-clip")).to_have_value("c1")
    page.select_option("#target-clip", "c10")
    question.get_by_role("button", name="Replace by cup.flac").click()
    assert last_call(panels) == ("change_target", {"target": "rim", "clip": "c10"})


def test_a_new_target_is_the_selected_one(panels, page):
    targets = panels.state["targets"]
    panels.change(targets=[*targets, target("bow", 0, None)])
    expect(page.locator("#target-name")).to_have_value("bow")
    panels.change(targets=targets)
    expect(page.locator("#target-name")).to_have_value("rim")


def test_every_clip_that_the_server_takes_can_be_picked(page):
    assert page.get_attribute("#target-file", "accept") == ",".join(CLIP_ENDINGS)
    taken = page.evaluate(
        """async (endings) => {
          const { kindOf } = await import("/page/solid/files.js");
          return endings.map((ending) => kindOf(new File([], `A.${ending.toUpperCase()}`)));
        }""",
        CLIP_ENDINGS,
    )
    assert taken == ["clip"] * len(CLIP_ENDINGS)


def test_an_extraction_tells_how_far_it_is_and_can_be_stopped(panels, page):
    clip = ready_clip() | {"modes": [], "phase": "listening"}
    doing = {"message": "bands of 98 Hz", "progress": 0.4}
    panels.open(state(clips=[clip | doing], wanted=None))
    details = page.locator(".target-details")
    expect(details).to_contain_text("Its modes are being found: bands of 98 Hz")
    expect(page.locator("#panel-targets .target-list")).to_contain_text("finding modes, 40 %")
    assert details.locator("progress").evaluate("each => each.value") == pytest.approx(0.4)
    panels.change(clips=[clip | {"message": "fitting what was found"}])
    expect(details.locator("progress:indeterminate")).to_be_visible()
    page.get_by_role("button", name="Stop finding modes").click()
    assert last_call(panels) == ("stop_extraction", {"clip": "c1"})
    panels.change(clips=[clip | {"phase": "stopped", "message": "it was stopped"}])
    expect(details.locator("progress")).to_be_hidden()
    expect(page.locator("#search-state")).to_contain_text("plate.wav cannot be used")
    page.get_by_role("button", name="Find its modes").click()
    assert last_call(panels, 2) == ("extract_again", {"clip": "c1"})


def test_modes_taken_are_a_number_or_all(panels, page):
    page.fill("#target-modes", "3")
    page.keyboard.press("Tab")
    assert last_call(panels) == ("change_target", {"target": "rim", "modes": 3})
    page.fill("#target-modes", "three")
    page.keyboard.press("Tab")
    expect(page.locator(".message.error")).to_contain_text("found three, expected a whole number")
    expect(page.locator("#target-modes")).to_have_value("")
    assert len(panels.calls) == 1


def test_a_clip_may_be_said_to_be_clipped(panels):
    panels.page.check("#target-clipped")
    assert last_call(panels) == ("change_target", {"target": "rim", "allow_clipped": True})


# Clip


def test_modes_of_a_clip_are_told(page):
    expect(page.locator("#panel-clip .figure-line")).to_have_text(
        "plate.wav: 4 of 4 modes used; all explain 95.63 % of the energy"
    )
    expect(page.locator("#panel-clip .says")).to_have_text("its first 12 ms are left out")
    page.get_by_text("Modes of the clip").first.click()
    first = page.locator("#panel-clip tbody tr").nth(1).locator("td.number")
    # 6.02 dB below the loudest, and ln 1000 / 8 s until it has fallen by 60 dB
    expect(first).to_have_text(["660.0", "8.0", "0.86", "\u22126.0"])


def test_a_mode_is_left_out_and_taken_back(panels, page):
    page.get_by_text("Modes of the clip").first.click()
    page.get_by_label("Use 990.0 Hz").uncheck()
    assert last_call(panels) == ("change_target", {"target": "rim", "without": [990.0]})
    before = ink(panels, "#panel-clip")
    left = [target("rim", 1, "c1") | {"without": [990.0]}, target("handle", 2, None)]
    panels.change(targets=left)
    expect(page.locator("#panel-clip .figure-line")).to_contain_text("3 of 4 modes used")
    expect(page.get_by_label("Use 990.0 Hz")).not_to_be_checked()
    assert ink(panels, "#panel-clip")["green"] < before["green"]
    page.get_by_role("button", name="Use all").click()
    assert last_call(panels, 2) == ("change_target", {"target": "rim", "without": []})


def test_a_mode_that_cannot_be_left_out_stays(panels, page):
    panels.refused["change_target"] = "Two modes have to stay."
    page.get_by_text("Modes of the clip").first.click()
    page.get_by_label("Use 990.0 Hz").click()
    expect(page.locator(".message.error")).to_contain_text("Two modes have to stay.")
    expect(page.get_by_label("Use 990.0 Hz")).to_be_checked()


def test_a_mode_of_a_clip_is_heard_alone(panels, page):
    page.get_by_text("Modes of the clip").first.click()
    page.get_by_role("button", name="990.0 Hz alone").click()
    [[what, seconds]] = panels.heard()
    assert what == "play"
    assert seconds == pytest.approx(np.log(1000) / 8, abs=1e-3)


def test_a_clip_that_failed_says_why(panels, page):
    clip = ready_clip() | {"phase": "failed", "message": "plate.wav is silent.", "modes": []}
    panels.open(state(clips=[clip], targets=[target("rim", 1, "c1")]))
    expect(page.locator("#panel-clip")).to_contain_text("plate.wav is silent.")
    expect(page.locator("#optimise")).to_be_disabled()
    expect(page.locator("#search-state")).to_contain_text("plate.wav cannot be used")


# Spectrum and errors


def test_both_spectra_are_drawn_and_follow_the_solid(panels):
    before = ink(panels, "#panel-spectrum")
    assert before["green"] > 100 and before["red"] > 100
    panels.tell(bank(NOW * 1.05, 2))
    after = ink(panels, "#panel-spectrum")
    assert after["sum"] != before["sum"] and after["green"] > 100


def test_without_clips_only_the_solid_is_drawn(panels):
    panels.open(state(targets=[target("rim", 1, None)], clips=[], wanted=None))
    panels.tell(bank(wanted=False))
    found = ink(panels, "#panel-spectrum")
    assert found["red"] > 100 and found["green"] == 0
    expect(panels.page.locator("#panel-errors .hint").first).to_be_visible()


def test_a_mode_under_the_pointer_is_read_out(page):
    over = page.locator("#panel-spectrum .u-over")
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    low, high = WANTED[0] / 1.2, WANTED[-1] * 1.2
    share = np.log(WANTED[2] / low) / np.log(high / low)
    page.mouse.move(box["x"] + share * box["width"], box["y"] + 0.5 * box["height"])
    expect(page.locator("#panel-spectrum .readout")).to_contain_text("Mode 3: 945.3 Hz")
    expect(page.locator("#panel-spectrum .readout")).to_contain_text("\u221280.0 cents, +6.0 dB")
    expect(page.locator("#panel-errors tr.pointed th")).to_contain_text("3")


def test_parts_of_a_spectrum_can_be_seen_larger(panels, page):
    """By dragging and by buttons; a search that goes on leaves the part as it is."""
    panel = page.locator("#panel-spectrum")
    low, high = WANTED[0] / 1.2, WANTED[-1] * 1.2
    shown = panel.locator(".zoom .hint")

    def ends() -> np.ndarray:
        return np.array(
            [float(x.replace(",", "")) for x in re.findall(r"[\d.,]+", shown.inner_text())]
        )

    def press(name: str) -> None:
        panel.get_by_role("button", name=name, exact=True).click()

    expect(panel.get_by_role("button", name="All frequencies")).to_be_disabled()
    over = panel.locator(".u-over")
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    y = box["y"] + 0.5 * box["height"]
    page.mouse.move(box["x"] + 0.5 * box["width"], y)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.75 * box["width"], y, steps=4)
    page.mouse.up()
    dragged = low * (high / low) ** np.array([0.5, 0.75])
    np.testing.assert_allclose(ends(), dragged, rtol=0.02)
    before = ink(panels, "#panel-spectrum")
    panels.tell(bank(NOW * 1.01, 2))
    assert ink(panels, "#panel-spectrum")["sum"] != before["sum"]
    np.testing.assert_allclose(ends(), dragged, rtol=0.02)
    press("More frequencies")
    assert np.ptp(np.log(ends())) == pytest.approx(2 * np.ptp(np.log(dragged)), rel=0.05)
    over.dblclick()
    expect(shown).to_have_text("all frequencies")
    press("Fewer frequencies")
    assert np.ptp(np.log(ends())) == pytest.approx(0.5 * np.log(high / low), rel=0.05)
    press("All frequencies")
    expect(shown).to_have_text("all frequencies")


def test_errors_are_told_and_the_worst_are_marked(page):
    rows = page.locator("#panel-errors tbody tr")
    expect(rows.nth(2).locator("td.number")).to_have_text(
        ["990.0", "945.3", "\u221280.0", "\u22120.45", "+6.0"]
    )
    rms = np.sqrt((30.0**2 + 80.0**2 + 3.0**2) / 4)
    expect(page.locator("#panel-errors .figure-line")).to_have_text(
        f"{rms:.1f} cents rms over 4 modes"
    )
    # Those that are not heard to be off are not marked.
    expect(page.get_by_label("among the farthest off")).to_have_count(2)


def test_levels_are_those_at_the_selected_target(page):
    # At the handle all are wanted as loud; the solid has 0.5, 0.25, 0.2 and 0.01 everywhere.
    page.evaluate("studio.selection.set({ target: 'handle' })")
    levels = page.locator("#panel-errors td.loudness")
    expect(levels).to_have_text(["0.0", "\u22126.0", "\u22128.0", "\u221234.0"])


def test_without_a_target_the_spectrum_is_that_of_the_point_struck_last(panels, page):
    panels.open(state(targets=[], clips=[], wanted=None))
    panels.tell(bank(wanted=False))
    spectrum = page.locator("#panel-spectrum")
    expect(spectrum).to_contain_text("At the first point")
    page.evaluate("studio.selection.set({ vertex: 2 })")
    expect(spectrum).to_contain_text("At the point struck last")
    assert ink(panels, "#panel-spectrum")["red"] > 100


def test_a_mode_of_the_solid_is_heard_alone(panels, page):
    alone = page.get_by_role("button", name="Mode 2 alone")
    alone.click()
    expect(alone).to_have_attribute("aria-pressed", "true")
    page.get_by_role("button", name="All modes again").click()
    expect(alone).to_have_attribute("aria-pressed", "false")
    assert panels.heard() == [["solo", [1]], ["strike", 1, 1], ["solo", None]]


def test_the_page_reckons_bark_and_cents_as_the_cost_does(panels):
    hertz = [30.0, 440.0, 1234.5, 9000.0]
    found = panels.page.evaluate(
        """async (hertz) => {
          const { bark, cents } = await import("/page/panels/numbers.js");
          return [hertz.map(bark), hertz.map((each) => cents(each, 440))];
        }""",
        hertz,
    )
    assert np.allclose(found[0], bark_of(np.array(hertz)), rtol=1e-12)
    assert np.allclose(found[1], cents_of(np.array(hertz), np.full(4, 440.0)), atol=1e-9)


# Cost


def test_the_cost_is_drawn_and_told(panels, page):
    panels.tell(progress(0.5, 2.0))
    panels.tell(progress(1.0, 1.0))
    line = page.locator("#panel-cost .figure-line")
    expect(line).to_have_text("1, 50.0 % below the first one; 11 evaluations in 1.0 s")
    before = ink(panels, "#panel-cost")
    panels.tell(progress(1.5, 0.1))
    expect(line).to_contain_text("0.1, 95.0 % below")
    assert ink(panels, "#panel-cost")["sum"] != before["sum"]
    panels.tell({"event": "history", "rows": [], "checks": []})
    expect(page.locator("#panel-cost .plot")).to_be_hidden()


def test_a_verdict_and_partials_without_a_mode_are_told(panels, page):
    near = "near the clip, not like it"
    panels.tell(bank(verdict=near, left_out_hz=[812.4, 1400.0], ended_by="met"))
    cost = page.locator("#panel-cost")
    expect(cost.locator(".verdict")).to_have_text("Verdict: near the clip, not like it.")
    beside = page.get_by_text("The design sounds near the clip, not like it; Cost says why.")
    expect(beside).to_be_visible()
    told = "No mode of this solid can have the clips' partials at 812, 1400 Hz: they are left out."
    expect(cost.get_by_text(told)).to_be_visible()
    expect(cost.get_by_text("The search ended before its time")).to_be_visible()
    panels.tell(bank())
    expect(cost.get_by_text("The search ended before its time")).to_be_hidden()
    expect(cost.locator(".verdict")).to_be_hidden()
    expect(beside).to_be_hidden()
    expect(cost.get_by_text("they are left out")).to_be_hidden()


def test_a_cost_of_any_size_is_drawn(panels):
    """An axis that begins at 0.0095, a little below a power of ten, is one."""
    panels.tell(progress(0.5, 9.18) | {"amplitude_cost": 0.01427, "regulariser": 0.5})
    assert ink(panels, "#panel-cost")["all"] > 0


def test_a_cost_that_rises_is_explained(panels, page):
    first, second = (
        {"seconds": at, "cost": cost, "coarse_rms_cents": 8.0, "fine_rms_cents": 35.0}
        for at, cost in ((0.1, 2.5), (1.2, 0.4))
    )
    panels.tell(progress(0.5, 2.0, first))
    panels.tell(progress(1.0, 0.1, first))
    says = page.locator("#panel-cost .says li")
    expect(says).to_have_count(1)
    panels.tell(progress(1.5, 0.3, first, second))
    line = page.locator("#panel-cost .figure-line")
    expect(line).to_have_text(
        "0.4 on the fine solid, 84.0 % below the first one; 16 evaluations in 1.5 s"
    )
    expect(says.nth(0)).to_contain_text("the cost on the fine solid: 0.4, by 2 checks")
    expect(says.nth(1)).to_contain_text("At 1.5 s the cost rises from 0.1 to 0.3: a check found")
    expect(says.nth(1)).to_contain_text("35.0 cents rms from the targets, the coarse one 8.0")
    panels.tell(progress(3.0, 0.6, first, second))
    expect(says.nth(2)).to_contain_text("rises from 0.3 to 0.6: a search began there")
    panels.tell(bank(cost=0.25, checked=True))
    expect(line).to_contain_text("0.25 on the fine solid, 90.0 % below the first one")
    expect(says.nth(0)).to_contain_text("the cost on the fine solid: 0.25")


# Settings


def test_only_what_was_changed_is_sent(panels, page):
    page.get_by_label("Resolution").fill("40")
    page.get_by_label("Weight of amplitudes").fill("2.5e1")
    page.get_by_label("Density [kg/m³]", exact=True).fill("1000")
    page.get_by_text("More settings").click()
    page.get_by_label("Bounds of the modulus, lowest").fill("0.01")
    page.get_by_label("Bounds of the modulus, highest").fill("400")
    page.get_by_label("Check on the fine solid").uncheck()
    page.get_by_role("button", name="Apply").click()
    assert last_call(panels) == (
        "change_settings",
        {
            "settings": {
                "resolution": 40,
                "weights": {"amplitude": 25},
                "material": {"young_bounds": [1e7, 4e11]},
                "optimiser": {"fine_check": False},
            }
        },
    )


def test_a_material_by_name_fills_in_its_constants(panels, page):
    preset = page.get_by_label("Material at the start")
    expect(preset).to_have_value("")
    preset.select_option("steel")
    expect(page.get_by_label("Young's modulus at the start [GPa]")).to_have_value("200")
    page.get_by_role("button", name="Apply").click()
    steel = named_material("steel")
    sent = {"density": steel.density, "poisson": steel.poisson}
    sent["material"] = {"young": steel.young}
    assert last_call(panels) == ("change_settings", {"settings": sent})
    now = panels.state["settings"]
    panels.change(settings=now | sent | {"material": now["material"] | sent["material"]})
    expect(preset).to_have_value("steel")
    page.get_by_label("Density [kg/m³]", exact=True).fill("7000")
    page.get_by_role("button", name="Apply").click()
    panels.change(settings=panels.state["settings"] | {"density": 7000.0})
    expect(preset).to_have_value("")
    panels.change(regions=[{"name": "body", "material": "iron", "dabs": None, "fault": None}])
    expect(preset).to_be_hidden()


@pytest.mark.parametrize(
    ("label", "typed", "said"),
    [
        ("Resolution", "1", "Resolution: found 1, expected a whole number of at least 2"),
        ("Resolution", "ten", "found ten, expected a whole number"),
        ("Modes", "1", "expected a whole number of at least 2, at most 10000 or auto."),
        ("Density", "", "Density: found nothing, expected a number"),
        ("Time of a search", "0", "found 0, expected a number of above 0"),
    ],
)
def test_what_does_not_fit_is_refused_with_a_sentence(panels, page, label, typed, said):
    field = page.locator("#panel-settings").get_by_label(label, exact=label == "Modes").first
    field.fill(typed)
    page.get_by_role("button", name="Apply").click()
    error = page.locator("#panel-settings .field-error:visible")
    expect(error).to_contain_text(said)
    expect(field).to_be_focused()
    expect(field).to_have_attribute("aria-invalid", "true")
    assert panels.calls == []


def test_empty_fields_and_words_are_sent_as_such(panels, page):
    page.get_by_label("Time of a search").fill("")
    page.get_by_label("Coarse solid").select_option("none")
    page.keyboard.press("Tab")
    page.get_by_role("button", name="Apply").click()
    sent = {"settings": {"coarsen": "none", "optimiser": {"seconds": None}}}
    assert last_call(panels) == ("change_settings", sent)


def test_what_is_typed_outlives_a_new_state_and_can_be_discarded(panels, page):
    page.get_by_label("Resolution").fill("40")
    panels.change(settings=panels.state["settings"] | {"resolution": 20, "density": 7800.0})
    expect(page.get_by_label("Density [kg/m³]", exact=True)).to_have_value("7800")
    expect(page.get_by_label("Resolution")).to_have_value("40")
    page.locator("#panel-settings").get_by_role("button", name="Discard").click()
    expect(page.get_by_label("Resolution")).to_have_value("20")


def test_settings_that_the_server_refuses_wait_with_its_sentence(panels, page):
    panels.refused["change_settings"] = "weights: expected at least one of them to be 1e-12 or more"
    page.get_by_label("Weight of frequencies").fill("0")
    page.get_by_role("button", name="Apply").click()
    expect(page.locator(".form-said")).to_contain_text("weights: expected at least one")
    expect(page.get_by_label("Weight of frequencies")).to_have_value("0")
    expect(page.get_by_role("button", name="Apply")).to_be_enabled()


NUMBERS = ["", "0", "-1", "1", "2", "2.5", "1e3", "30.0", "0.3", "0.5", "1e-5", "1e30", "auto", "x"]


def test_the_page_takes_the_numbers_that_projects_take(panels):
    fields = dict(_numbers(schema_of(Project)))
    taken = panels.page.evaluate(
        """async ([fields, texts]) => {
          const { readNumber, FieldError } = await import("/page/panels/values.js");
          const takes = (text, schema) => {
            try { readNumber(text, schema, ""); return true; }
            catch (error) { if (error instanceof FieldError) return false; throw error; }
          };
          return Object.entries(fields).map(([name, schema]) =>
            [name, texts.filter((text) => takes(text, schema))]);
        }""",
        [fields, NUMBERS],
    )
    assert len(taken) > 10
    for name, texts in taken:
        assert texts == [text for text in NUMBERS if _fits(text, fields[name])], name


def _numbers(schema, path=""):
    """All settings that are numbers, by their names."""
    for key, part in schema["properties"].items():
        if "properties" in part:
            yield from _numbers(part, f"{path}{key}.")
        elif {"number", "integer"} & set(np.atleast_1d(part.get("type", "none"))):
            yield path + key, part


def _fits(text: str, schema) -> bool:
    """Whether a file may have what is typed; an empty field is its null."""
    value = None if text == "" else yaml.safe_load(text) if text in ("auto", "x") else float(text)
    return bool(Draft202012Validator(schema).is_valid(value))


# The design as a whole


def test_a_search_is_started_and_stopped(panels, page):
    panels.open(state(targets=[target("rim", 1, "c1")]))
    button = page.locator("#optimise")
    button.click()
    assert last_call(panels) == ("optimise", {})
    panels.change(search={"phase": "running", "message": None})
    expect(button).to_have_text("Stop")
    panels.tell(progress(12.0, 0.3))
    expect(page.locator("#search-state")).to_have_text("The material is being sought for 12 s.")
    button.click()
    assert last_call(panels, 2) == ("stop", {})
    panels.change(search={"phase": "idle", "message": None})
    expect(button).to_have_text("Optimise")


def test_without_a_solid_it_says_what_is_missing(panels, page):
    panels.open(state(solid=None, targets=[], clips=[], wanted=None, name=""))
    expect(page.locator("#search-state")).to_have_text("Open a solid first.")
    expect(page.locator("#optimise")).to_be_disabled()


def test_the_fine_solid_is_asked_for(panels, page):
    page.get_by_label("Fine solid:").check()
    assert last_call(panels) == ("fine", {"on": True})
    panels.change(fine={"on": True, "phase": "working", "message": None})
    expect(page.locator("#panel-project")).to_contain_text("It is being computed")


def test_a_project_is_saved_and_opened(panels, page):
    page.get_by_text("Save, open, export").click()
    page.fill("#project-name-input", "pan 2")
    page.keyboard.press("Enter")
    expect(page.locator("#project-name-help")).to_contain_text("found pan 2, expected up to 64")
    assert panels.calls == []
    page.fill("#project-name-input", "pan-2")
    page.keyboard.press("Enter")
    assert last_call(panels) == ("save", {"name": "pan-2"})
    page.select_option("#project-choice", label="recorded-bell")
    page.locator("#panel-project").get_by_role("button", name="Open").click()
    assert last_call(panels, 2) == ("open_project", {"project": "e1"})


def test_exports_are_downloads_and_refusals_are_told(panels, page):
    page.get_by_text("Save, open, export").click()
    with page.expect_download() as download:
        page.get_by_role("button", name="Design (HDF5)").click()
    assert download.value.suggested_filename == "pan design.h5"
    assert Path(download.value.path()).read_bytes() == b"design"
    page.get_by_role("button", name="Faust (DSP)").click()
    expect(page.locator(".message.error")).to_contain_text("There is no design yet")
    # The browser itself notes an answer of status 400.
    panels.faults.clear()


def test_the_material_is_forgotten(panels, page):
    page.get_by_text("Save, open, export").click()
    page.get_by_role("button", name="Forget the material").click()
    assert last_call(panels) == ("forget_material", {})


# Comparing


def test_clip_and_solid_are_heard_in_turn(panels, page):
    page.get_by_role("button", name="Clip, then solid").click()
    until(panels, lambda: page.evaluate("window.heard.length") == 2)
    assert panels.heard() == [["play", "/clip/c1/sound"], ["strike", 1, 1]]


def test_a_swapped_material_is_heard_once_it_is_there(panels, page):
    swap = page.get_by_role("button", name="Swap")
    expect(swap).to_be_disabled()
    page.keyboard.press("k")
    assert last_call(panels) == ("keep", {})
    panels.change(heard="B")
    expect(page.get_by_text("You hear B; swap to hear A.")).to_be_visible()
    swap.click()
    assert last_call(panels, 2) == ("swap", {})
    page.wait_for_timeout(100)
    assert panels.heard() == []
    panels.tell(bank(WANTED, 2))
    until(panels, lambda: page.evaluate("window.heard.length") == 1)
    assert panels.heard() == [["strike", 1, 1]]


def test_keys_compare_but_steal_no_typing(panels, page):
    panels.change(heard="A")
    page.locator("body").click(position={"x": 5, "y": 300})
    for key in "cbx":
        page.keyboard.press(key)
    assert last_call(panels) == ("swap", {})
    assert panels.heard()[:2] == [["play", "/clip/c1/sound"]] * 2
    page.focus("#target-name")
    page.keyboard.type("kxcb?")
    page.wait_for_timeout(100)
    assert len(panels.calls) == 1
    expect(page.locator("dialog[open]")).to_have_count(0)


# Messages, keys, tour


def test_errors_stay_until_dismissed_and_all_are_listed(panels, page):
    panels.tell({"event": "said", "text": "Saved <b>here</b>.", "kind": "note"})
    panels.tell({"event": "said", "text": "The disk is full; free some space.", "kind": "error"})
    expect(page.get_by_role("status").filter(has_text="Saved <b>here</b>.").first).to_be_visible()
    error = page.locator(".message.error")
    expect(error).to_have_text("Error: The disk is full; free some space.\u00d7")
    error.get_by_role("button", name="Dismiss").click()
    expect(error).to_have_count(0)
    panels.tell({"event": "said", "text": "There is no target.", "kind": "error"})
    expect(error).to_have_count(1)
    panels.change(name="another")
    expect(error).to_have_count(0)
    page.get_by_role("button", name="3 messages").click()
    expect(page.locator(".message-list li")).to_have_count(3)
    page.keyboard.press("Escape")
    expect(page.locator("dialog[open]")).to_have_count(0)


def test_all_keys_are_listed(page):
    page.locator("body").click(position={"x": 5, "y": 300})
    page.keyboard.press("?")
    listed = page.locator("table.keys tbody tr")
    expect(listed).to_have_count(page.evaluate("studio.keys.list.length"))
    expect(listed.filter(has_text="Redo")).to_contain_text("Ctrl+Shift+Z or Ctrl+Y")
    page.get_by_role("button", name="Close").click()
    expect(page.locator("dialog[open]")).to_have_count(0)


def test_the_tour_begins_by_itself_once(browser):
    with window(browser, tour=True) as panels:
        panels.open()
        page = panels.page
        expect(page.get_by_role("dialog", name="Open a solid")).to_be_visible()
        expect(page.locator("#tour-title")).to_be_focused()
        titles = []
        for step in range(1, 6):
            expect(page.locator(".tour-count")).to_have_text(f"Step {step} of 5")
            titles.append(page.locator("#tour-title").inner_text())
            expect(page.locator(".tour-here")).to_have_count(1)
            page.get_by_role("button", name="Done" if step == 5 else "Next").click()
        assert len(set(titles)) == 5
        expect(page.locator(".tour-card")).to_be_hidden()
        expect(page.locator(".tour-here")).to_have_count(0)
        page.reload()
        page.wait_for_selector("#panel-compare button")
        page.wait_for_timeout(200)
        expect(page.locator(".tour-card")).to_be_hidden()


def test_escape_ends_the_tour_and_the_focus_goes_back(page):
    page.focus("#help")
    page.keyboard.press("Enter")
    expect(page.locator("#tour-title")).to_be_focused()
    page.keyboard.press("Escape")
    expect(page.locator(".tour-card")).to_be_hidden()
    expect(page.locator("#help")).to_be_focused()


# For everybody


def show_all(panels) -> None:
    """Unfold what is folded, and draw what is drawn."""
    panels.tell(progress(0.5, 2.0))
    panels.tell(progress(1.0, 1.0))
    panels.tell({"event": "said", "text": "A sentence.", "kind": "error"})
    panels.page.evaluate("document.querySelectorAll('details').forEach((each) => each.open = true)")
    panels.page.wait_for_timeout(100)


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 390])
def test_axe_finds_nothing_serious(browser, width, scheme):
    with window(browser, width=width, scheme=scheme) as panels:
        panels.open()
        show_all(panels)
        for opening in ("", "studio.shortcuts.open()", "studio.tour.open()"):
            panels.page.evaluate(opening)
            assert axe_finds(panels.page) == []
            panels.page.evaluate("document.querySelector('dialog[open]')?.close()")


def test_nothing_is_wider_than_a_narrow_window(browser):
    with window(browser, width=360, height=740) as panels:
        panels.open()
        show_all(panels)
        assert panels.page.evaluate("document.documentElement.scrollWidth") <= 360
        wide = panels.page.evaluate(
            "[...document.querySelectorAll('.panel-body *')]"
            ".filter((each) => !each.closest('.scroll')"
            " && each.getClientRects().length && each.getBoundingClientRect().right > 361)"
            ".map((each) => each.outerHTML.slice(0, 100))"
        )
        assert wide == []


def test_the_tab_key_reaches_every_control(panels, page):
    show_all(panels)
    enabled = page.evaluate(
        "[...document.querySelectorAll('.side button, .side select, .side summary, .side input')]"
        ".filter((each) => !each.disabled && each.tabIndex >= 0 && each.checkVisibility()"
        " && !(each.type === 'radio' && !each.checked)).length"
    )
    page.focus("#help")
    reached = 0
    for _ in range(3 * enabled):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement === document.body"):
            break
        reached += page.evaluate(
            "document.activeElement.closest('.side') !== null"
            " && document.activeElement.matches('button, select, summary, input')"
        )
        if reached == enabled:
            break
    assert reached == enabled
