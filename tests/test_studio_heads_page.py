"""Comparisons of measured heads on the studio's page: what is asked, drawn, played and written."""

import json

import numpy as np
import pytest

from sound.heads.head_space import distance, read_heads
from sound.heads.measured_head import read_head
from sound.heads.stimulus import DIRECTIONS, direction_of
from tests.panels_page import state, window
from tests.studio_load import real_studio
from tests.studio_pages import axe_finds, open_page, until_page
from tests.studio_stub import heads_entry
from tests.synthetic_heads import Anatomy, sphere_directions, write_head
from tests.test_studio_panels import expect, last_call, until

pytestmark = pytest.mark.nightly(unless=("studio",))

FOLDERS = [{"name": "alone", "heads": 1}, {"name": "cipic", "heads": 45}]
READ = {
    "folders": FOLDERS,
    "folder": "cipic",
    "phase": "ready",
    "heads": 45,
    "comparisons": 3,
    "direction": [0.5, -(0.75**0.5), 0.0],
    "file": "cipic-calibration.json",
}


def entry(**changes):
    """Heads that are read, before the fourth comparison."""
    return heads_entry(**(READ | changes))


@pytest.fixture(scope="module")
def wide(browser):
    """A window of a desktop."""
    with window(browser) as wide:
        yield wide


def unfold(panels):
    panels.page.locator("#panel-heads summary").click()
    assert last_call(panels) == ("look_for_heads", {})
    panels.calls.clear()


@pytest.fixture
def panels(wide):
    """The page with heads that are read, the panel unfolded."""
    wide.open(state(heads=entry()))
    unfold(wide)
    yield wide
    assert wide.faults == []


@pytest.fixture
def page(panels):
    return panels.page


@pytest.fixture
def panel(page):
    return page.locator("#panel-heads")


def next_of(panel):
    return panel.get_by_role("button", name="Next")


# Folders


def test_the_panel_is_folded_until_it_is_used(wide):
    wide.open()
    panel = wide.page.locator("#panel-heads")
    expect(panel.get_by_role("button")).to_have_count(0)
    assert wide.calls == []
    unfold(wide)
    expect(panel).to_contain_text("The workspace stub has no folder of two or more measured heads")
    expect(panel).to_contain_text("sofaconventions.org")
    panel.get_by_role("button", name="Look again").click()
    assert last_call(wide) == ("look_for_heads", {})
    wide.change(heads=heads_entry(folders=FOLDERS[:1]))
    expect(panel.get_by_label("Folder")).to_be_hidden()


def test_a_folder_is_read_with_progress(panels, page, panel):
    panels.change(heads=heads_entry(folders=FOLDERS))
    folder = panel.get_by_label("Folder")
    expect(folder.locator("option")).to_have_text(["cipic, 45 heads"])
    read = panel.get_by_role("button", name="Read its heads")
    read.click()
    assert last_call(panels) == ("open_heads", {"folder": "cipic"})
    said = {"message": "reading subject_021.sofa", "progress": 0.5}
    panels.change(heads=heads_entry(folders=FOLDERS, folder="cipic", phase="reading", **said))
    expect(panel).to_contain_text("cipic: reading subject_021.sofa")
    expect(panel.locator("progress")).to_have_js_property("value", 0.5)
    expect(read).to_be_disabled()
    panels.change(heads=entry(comparisons=0))
    expect(panel.locator("progress")).to_be_hidden()
    expect(panel).to_contain_text("45 heads of cipic; answers are kept in cipic-calibration.json.")
    expect(panel).to_contain_text("0 comparisons so far. Stop whenever you like")
    expect(panel.get_by_role("button", name="Begin anew")).to_be_hidden()


def test_what_is_wrong_with_heads_is_told_and_the_folder_of_last_time(panels, panel):
    sentence = "cipic-calibration.json: is of other heads (a, b, c ...)"
    panels.change(
        heads=heads_entry(folders=FOLDERS, folder="cipic", phase="failed") | {"message": sentence}
    )
    expect(panel.locator(".field-error")).to_have_text(sentence)
    expect(next_of(panel)).to_be_hidden()
    panels.change(heads=heads_entry(folders=FOLDERS, folder="cipic"))
    expect(panel).to_contain_text("Last time the heads were those of cipic; read them to go on.")
    expect(panel.get_by_label("Folder")).to_have_value("cipic")
    expect(panel.get_by_role("button", name="Read its heads")).to_be_enabled()


# Comparisons


def test_a_pair_is_played_and_answered(panels, page, panel):
    panel.get_by_role("button", name="A", exact=True).click()
    panel.get_by_role("button", name="B", exact=True).click()
    panel.get_by_label("Sound", exact=True).select_option("strike")
    panel.get_by_role("button", name="A", exact=True).click()
    path = "/heads/3/{}?stimulus={}"
    parts = [("A", "noise"), ("B", "noise"), ("A", "strike")]
    assert panels.heard() == [["play", path.format(*each)] for each in parts]
    expect(next_of(panel)).to_be_disabled()
    panel.get_by_label("B better").check()
    next_of(panel).click()
    assert last_call(panels) == ("compare_heads", {"number": 3, "score": 4})
    panels.change(heads=entry(comparisons=4))
    expect(panel).to_contain_text("4 comparisons so far")
    expect(panel.locator("input:checked")).to_have_count(0)
    expect(next_of(panel)).to_be_disabled()
    panels.heard()
    for part in ("After", "Before"):
        panel.get_by_role("button", name=part).click()
    path = path.replace("3", "4")
    assert panels.heard() == [["play", path.format(p, "strike")] for p in ("after", "before")]


def test_keys_answer_where_the_focus_is_in_the_comparison(panels, page, panel):
    panels.page.evaluate("studio.selection.set({ vertex: 2 })")
    group = panel.locator(".comparison")
    group.focus()
    for key in "ab":
        page.keyboard.press(key)
    path = "/heads/3/{}?stimulus=noise"
    assert panels.heard() == [["play", path.format(part)] for part in "AB"]
    page.keyboard.press("Enter")
    page.keyboard.press("2")
    expect(panel.get_by_label("A better", exact=True)).to_be_checked()
    assert panels.calls == []
    page.keyboard.press("Enter")
    assert last_call(panels) == ("compare_heads", {"number": 3, "score": 2})
    panels.change(heads=entry(comparisons=4))
    expect(group).to_be_focused()
    page.keyboard.press("5")
    page.keyboard.press("Enter")
    assert last_call(panels, 2) == ("compare_heads", {"number": 4, "score": 5})
    # Elsewhere these keys are those of the solid and of the clip.
    page.locator("body").click(position={"x": 5, "y": 300})
    page.evaluate("document.activeElement.blur()")
    panels.heard()
    page.keyboard.press("b")
    until(panels, lambda: page.evaluate("window.heard.length") > 0)
    assert panels.heard()[0] == ["play", "/clip/c1/sound"]


def test_an_answer_that_is_refused_stays(panels, panel):
    panels.refused["compare_heads"] = "The disk is full; free some space."
    panel.get_by_label("the same").check()
    next_of(panel).click()
    expect(panels.page.locator(".message.error")).to_contain_text("The disk is full")
    expect(panel.get_by_label("the same")).to_be_checked()
    expect(next_of(panel)).to_be_enabled()


WORDS = {
    (0.0, 0.0): "ahead",
    (180.0, 0.0): "behind",
    (0.0, 45.0): "ahead, 45\u00b0 up",
    (-60.0, 0.0): "60\u00b0 to the right",
    (150.0, 30.0): "behind on the left (150\u00b0), 30\u00b0 up",
    (0.0, -30.0): "ahead, 30\u00b0 down",
    (0.0, 90.0): "straight above",
}


def test_directions_are_told_and_drawn_from_above_and_from_the_side(panels, panel):
    """To the left is left from above; ahead is right from the right side."""
    for number, angles in enumerate(DIRECTIONS):
        direction = direction_of(number)
        panels.change(heads=entry(comparisons=number + 10, direction=direction.tolist()))
        if angles in WORDS:
            expect(panel.locator(".figure-line")).to_have_text(
                f"Meant to come from {WORDS[angles]}"
            )
        expect(panel.locator(".hint", has_text="so far")).to_contain_text(f"{number + 10} ")
        places = panel.locator(".direction-source").evaluate_all(
            "(found) => found.map((each) => [each.cx.baseVal.value, each.cy.baseVal.value])"
        )
        ahead, left, up = 46.0 * direction
        expected = 60.0 + np.array([[-left, -ahead], [ahead, -up]])
        np.testing.assert_allclose(places, expected, atol=1e-3)
    above = panel.get_by_role("img", name="Seen from above: the sound comes from straight above")
    expect(above).to_be_visible()


# The blend


def test_the_blend_is_written_and_said_how_scenes_use_it(panels, panel):
    panel.get_by_role("button", name="Write the blend").click()
    assert last_call(panels) == ("write_blend", {})
    panels.change(heads=entry(blend={"file": "cipic-blend.sofa", "comparisons": 1}))
    expect(panel).to_contain_text(
        "cipic-blend.sofa is that after 1 comparison. A scene is heard by it with "
        "listener: {hrtf: cipic-blend.sofa}."
    )


def test_answers_are_left_for_a_beginning_only_after_a_question(panels, page, panel):
    anew = panel.get_by_role("button", name="Begin anew")
    anew.click()
    question = page.get_by_role("dialog")
    expect(question).to_contain_text("The answers so far are kept as cipic-calibration.json~.")
    question.get_by_role("button", name="Go on").click()
    assert panels.calls == []
    anew.click()
    question.get_by_role("button", name="Begin anew").click()
    assert last_call(panels) == ("open_heads", {"folder": "cipic", "anew": True})


# For everybody


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 390])
def test_axe_finds_nothing_serious_and_nothing_is_too_wide(browser, width, scheme):
    with window(browser, width=width, scheme=scheme) as panels:
        panels.open(state(heads=entry(blend={"file": "cipic-blend.sofa", "comparisons": 3})))
        unfold(panels)
        panels.page.get_by_label("A much better").check()
        assert axe_finds(panels.page) == []
        assert panels.page.evaluate("document.documentElement.scrollWidth") <= width
        beyond = panels.page.evaluate(
            "[...document.querySelectorAll('#panel-heads *')].filter((each) => {"
            "  const { right, left } = each.getBoundingClientRect();"
            "  const panel = document.querySelector('#panel-heads').getBoundingClientRect();"
            "  return right > panel.right || (right > 0 && left < panel.left); })"
            ".map((each) => each.outerHTML.slice(0, 100))"
        )
        assert beyond == []


@pytest.mark.nightly
def test_a_listener_answers_stops_and_goes_on_with_another_studio(browser, tmp_path):
    """Real heads, sounds and files; the second studio goes on with what the first one kept."""
    folder = tmp_path / "people"
    folder.mkdir()
    for name, scale in (("large", 1.15), ("small", 0.85), ("usual", 1.0)):
        write_head(folder / f"{name}.sofa", Anatomy(scale=scale), sphere_directions(step=30.0))
    for begun in (0, 4):
        with real_studio(tmp_path) as address:
            page = open_page(browser, address, "studio.state?.current")
            panel = page.locator("#panel-heads")
            panel.locator("summary").click()
            panel.get_by_role("button", name="Read its heads").click()
            expect(panel).to_contain_text(f"{begun} comparisons so far")
            page.evaluate("studio.player.onChange((name) => (window.last = name))")
            for number in range(begun, begun + 4):
                panel.get_by_role("button", name="AB"[number % 2], exact=True).click()
                until_page(page, f"window.last?.startsWith('/heads/{number}/')")
                until_page(page, "!studio.player.playing")
                panel.locator(".comparison").focus()
                page.keyboard.press(str(1 + number % 5))
                page.keyboard.press("Enter")
                until_page(page, f"studio.state.current.heads.comparisons === {number + 1}")
            panel.get_by_role("button", name="Write the blend").click()
            expect(panel).to_contain_text("listener: {hrtf: people-blend.sofa}")
            assert page.faults == []
            page.context.close()
    assert len(json.loads((tmp_path / "people-calibration.json").read_text())["comparisons"]) == 8
    blend = read_head(tmp_path / "people-blend.sofa")
    assert distance(blend, read_heads(folder).heads[0]) > 0.1
