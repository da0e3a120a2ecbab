"""The studio page's frame, in a browser: calls, uploads, connection, choices, keys, header."""

from urllib.parse import urlsplit

import pytest

from tests.studio_pages import ToldStudio, axe_finds, open_page, serving, until, until_page

pytestmark = pytest.mark.nightly(unless=("studio",))

CALLED = """async ([name, values]) => {
  return studio.connection.call(name, values).then(() => null, (error) => error.message);
}"""


@pytest.fixture(scope="module")
def opened(browser):
    studio = ToldStudio()
    with serving(studio) as address:
        yield studio, open_page(browser, address)


@pytest.fixture
def studio(opened):
    opened[0].anew()
    return opened[0]


@pytest.fixture
def page(opened, studio):
    page = opened[1]
    until_page(page, f"studio.state.current.revision >= {studio.state()['revision']}")
    yield page
    assert page.faults == []


def test_a_call_is_answered_or_refused_by_the_servers_sentence(page, studio):
    assert page.evaluate(CALLED, ["keep", {}]) is None
    assert studio.calls[-1] == ("keep", {})
    told = page.evaluate(CALLED, ["remove_target", {"target": "nowhere"}])
    assert told == "there is no target 'nowhere'"


def test_an_upload_is_named_or_refused_by_the_servers_sentence(page, studio):
    upload = """async (text) => {
      const blob = new Blob([text]);
      return studio.connection.upload("clip", "ding dong & more.wav", blob).catch((e) => e.message);
    }"""
    assert page.evaluate(upload, "RIFF") == "c2"
    assert studio.uploads == [("clip", "ding dong & more.wav", 4)]
    assert "is not readable as sound" in page.evaluate(upload, "none")


def test_arrays_arrive_as_they_were_sent(page, studio):
    told = page.evaluate(
        """async () => {
          const { header, arrays } = await studio.connection.binary("/surface/1");
          return [header.number, arrays.positions.length, arrays.triangles.length,
                  arrays.triangles.constructor.name, [...arrays.positions.subarray(0, 3)]];
        }"""
    )
    solid = studio.state()["solid"]
    assert told[:4] == [1, 3 * solid["vertices"], 3 * solid["triangles"], "Uint32Array"]
    assert told[4] == pytest.approx(studio._mesh.vertices[0].tolist(), rel=1e-6)


def test_a_fault_of_one_part_keeps_no_other_from_hearing(page, studio):
    page.evaluate(
        """() => {
          window.heard = [];
          studio.state.onChange((now, before) => { if (before) throw new Error("a fault") });
          studio.state.onChange((now) => window.heard.push(now.name));
        }"""
    )
    studio.tell(name="kettle")
    until_page(page, "window.heard.includes('kettle')")


def test_a_target_that_is_renamed_or_gone_stays_chosen_or_gives_way(page, studio):
    for name in ("one", "two", "three"):
        assert page.evaluate(CALLED, ["add_target", {"vertex": 5, "name": name}]) is None
    until_page(page, "studio.state.current.targets.length === 4")
    page.evaluate("studio.selection.set({ target: 'two' })")
    page.evaluate(CALLED, ["change_target", {"target": "two", "name": "deux"}])
    until_page(page, "studio.selection.current.target === 'deux'")
    page.evaluate(CALLED, ["remove_target", {"target": "deux"}])
    until_page(page, "studio.selection.current.target === 'rim'")


def test_the_header_undoes_redoes_saves_and_tells_the_name(page, studio):
    undo, redo = page.locator("#undo"), page.locator("#redo")
    assert undo.is_disabled() and redo.is_disabled()
    studio.tell(name="pan", saved=False, undo="add target handle", redo="move rim")
    until_page(page, "document.title.startsWith('pan')")
    assert page.locator("#project-name").inner_text() == "pan (not saved)"
    page.get_by_role("button", name="Undo: add target handle").click()
    page.get_by_role("button", name="Redo: move rim").click()
    page.keyboard.press("Control+z")
    page.keyboard.press("Control+Shift+z")
    page.keyboard.press("Control+s")
    until(lambda: len(studio.calls) == 5)
    assert [name for name, _ in studio.calls] == ["undo", "redo", "undo", "redo", "save"]
    assert studio.calls[-1][1] == {"name": "pan"}


def test_keys_leave_typing_and_pressing_alone(page):
    page.evaluate(
        """() => {
          window.pressed = [];
          studio.keys.add(["q", "Enter", "Shift+ArrowUp", "Control+q"], "a test", (event) => {
            window.pressed.push(event.key);
          });
        }"""
    )
    page.locator("body").press("q")
    page.locator("body").press("Shift+ArrowUp")
    page.locator("body").press("Control+q")
    page.locator("body").press("Alt+q")
    page.locator("#panel-targets input[type=text]").first.press("q")
    page.locator("#open").press("Enter")
    page.keyboard.press("Escape")
    assert page.evaluate("window.pressed") == ["q", "ArrowUp", "q"]


def test_a_lost_server_is_told_and_found_again(browser):
    with serving(ToldStudio()) as address:
        port = urlsplit(address).port
        page = open_page(browser, address)
    until(lambda: "does not answer" in page.locator("#connection-status").inner_text())
    assert "does not answer" in page.evaluate(CALLED, ["undo", {}])
    page.locator("body").press("Enter")
    assert len(page.evaluate("window.strikes")) == 1  # what rings needs no server
    with serving(ToldStudio(), port):
        # Another run has another secret, so it lets in who knows that alone.
        until_page(page, "studio.connection.status === 'refused'")
        assert "open the address that it printed" in page.locator("#connection-status").inner_text()
    page.context.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_in_the_frame(browser, scheme):
    studio = ToldStudio()
    solid = studio.state()["solid"]
    states = (
        {},
        {"solid": {**solid, "phase": "preparing"}},
        {"solid": {**solid, "phase": "failed", "message": "cup.stl: is not closed."}},
        {"solid": None, "targets": [], "clips": [], "wanted": None},
    )
    with serving(studio) as address:
        page = open_page(browser, address, color_scheme=scheme)
        for told in states:
            studio.tell(**told)
            until_page(page, f"studio.state.current.revision >= {studio.state()['revision']}")
            for opening in ("", "studio.view.openChooser()"):
                page.evaluate(opening)
                assert axe_finds(page, ("minor", "moderate", "serious", "critical", None)) == []
            page.keyboard.press("Escape")
        page.context.close()


def test_how_it_sounds_is_set_over_the_view(page):
    page.get_by_label("Volume").fill("0.5")
    assert page.evaluate("studio.bank.volume") == 0.5
    page.locator(".sounding-more summary").click()
    page.get_by_label("Contact").fill("2")
    page.get_by_label("With the clips' noise").check()
    assert page.evaluate("[studio.bank.contactSeconds, studio.noise.on]") == [0.002, True]
    page.get_by_label("Contact").press("Escape")
    assert not page.get_by_label("Contact").is_visible()
