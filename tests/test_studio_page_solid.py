"""The solid on the studio's page, in a browser: what is seen, struck, placed, dropped and told."""

import io

import numpy as np
import pytest
import trimesh
from PIL import Image

from tests.studio_pages import (
    TWO_FRAMES,
    ToldStudio,
    open_page,
    serving,
    until,
    until_page,
    until_still,
)

pytestmark = pytest.mark.nightly(unless=("studio",))

MIDDLE = "studio.view.drawing.middle()"


@pytest.fixture(scope="module")
def opened(browser):
    """A made-up studio and its page, which take a while to open."""
    studio = ToldStudio()
    with serving(studio) as address:
        yield studio, open_page(browser, address)


@pytest.fixture
def studio(opened):
    return opened[0]


@pytest.fixture
def page(opened):
    """The page as it was opened."""
    studio, page = opened
    studio.anew()
    revision = studio.state()["revision"]
    until_page(page, f"studio.state.current.revision >= {revision} && studio.view.settled")
    page.evaluate(
        """() => {
          document.activeElement.blur();
          // What was said before lies over the view.
          for (const said of document.querySelectorAll("#messages button")) said.click();
          studio.view.drawing.reset();
          studio.selection.set(
            { target: "rim", vertex: null, strength: 1, tool: "strike", holding: false });
          window.strikes = [];
        }"""
    )
    page.mouse.move(1, 1)
    until_still(page)
    page.faults.clear()
    yield page
    assert page.faults == []


def pixels(page) -> np.ndarray:
    """The solid's view as (height, width, 3), once nothing moves."""
    until_still(page)
    return np.asarray(
        Image.open(io.BytesIO(page.locator("#view canvas").screenshot())).convert("RGB"), float
    )


def difference(one: np.ndarray, other: np.ndarray) -> float:
    """Mean difference of two images, of 255."""
    return float(np.abs(one - other).mean())


def seen(page, count: int = 40) -> list[tuple[int, float, float]]:
    """Some vertices that the camera sees, with their pixels."""
    found = page.evaluate(
        """(count) => {
          const { view } = studio;
          const total = view.drawing.surface.positions.length / 3;
          const found = [];
          const { camera, surface } = view.drawing;
          const facing = (vertex) => {
            const inward = camera.position.clone().fromArray(view.marks.inward, 3 * vertex);
            return surface.at(vertex).sub(camera.position).normalize().dot(inward);
          };
          for (let i = 0; i < 12 * count && found.length < count; i++) {
            const vertex = Math.floor((i * 0.6180339887 % 1) * total);
            const at = view.project(vertex);
            const free = document.elementFromPoint(at.x, at.y) === view.drawing.canvas;
            // Away from the silhouette, where a pixel is another vertex's.
            if (!at.hidden && free && facing(vertex) > 0.3) found.push([vertex, at.x, at.y]);
          }
          return found;
        }""",
        count,
    )
    assert len(found) >= count // 2
    return [tuple(each) for each in found]


def oklab(colours: np.ndarray) -> np.ndarray:
    """Linear red, green and blue, (n, 3), in Ottosson's perceptual space."""
    cones = [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
    opponents = [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
    return np.cbrt(colours @ np.transpose(cones)) @ np.transpose(opponents)


def strikes(page) -> list[list[float]]:
    return page.evaluate("window.strikes")


def beside(page) -> tuple[float, float]:
    """Pixels of the view where there is no solid."""
    box = page.locator("#view canvas").bounding_box()
    x, y = box["x"] + 30, box["y"] + box["height"] / 2
    assert page.evaluate(f"studio.view.pick({x}, {y})") is None
    return x, y


def direction(page) -> np.ndarray:
    """Where the camera is from what it looks at, once it stands still."""
    read = "(() => { const { camera, controls } = studio.view.drawing;"
    read += " return camera.position.clone().sub(controls.target).toArray() })()"
    before = np.zeros(3)
    while True:
        now = np.array(page.evaluate(read))
        if np.allclose(before, now, rtol=0, atol=1e-7 * np.linalg.norm(now)):
            return now
        before = now
        page.evaluate(TWO_FRAMES)


def test_the_map_gets_lighter_by_even_steps(page):
    told = page.evaluate(
        """async () => {
          const { MAP, span } = await import("/page/solid/colours.js");
          return { map: [...MAP], uniform: span(new Float32Array([1e9, 1e9]), null),
                   kept: span(new Float32Array([2e9, 5e9]), [9, 10]),
                   wide: span(new Float32Array([1.5e7, 3e11]), [9, 10]) };
        }"""
    )
    colours = np.reshape(told["map"], (-1, 3))
    assert colours.min() >= 0.0 and colours.max() <= 1.0
    assert np.all(np.diff(colours @ [0.2126, 0.7152, 0.0722]) > 0.0)
    steps = np.linalg.norm(np.diff(oklab(colours), axis=0), axis=1)
    assert np.ptp(steps) < 0.2 * steps.mean()
    assert told["uniform"] == pytest.approx([8.5, 9.5])
    assert told["kept"] == [9, 10]
    assert told["wide"][0] <= np.log10(1.5e7) and told["wide"][1] >= np.log10(3e11)


def test_pixels_follow_material_and_camera(page, studio):
    before = pixels(page)
    assert before.std() > 10.0
    writes = page.evaluate("studio.view.drawing.surface.geometry.attributes.color.version")
    studio.soften(0.2)
    until_page(page, f"studio.view.drawing.surface.geometry.attributes.color.version > {writes}")
    softer = pixels(page)
    assert difference(before, softer) > 1.0
    geometry = "studio.view.drawing.surface.geometry.attributes"
    assert page.evaluate(f"{geometry}.position.version") == 0  # colours alone were written
    page.locator("#view canvas").press("ArrowLeft")
    direction(page)
    assert difference(softer, pixels(page)) > 1.0


def test_legend_tells_moduli_in_gigapascals(page, studio):
    ticks = [float(t) for t in page.locator(".legend-ticks span").all_inner_texts()]
    assert ticks == sorted(ticks) and min(ticks) == 0.1 and max(ticks) == 10.0
    vertex, x, y = seen(page, 4)[0]
    page.mouse.move(x, y)
    here = until(lambda: page.locator(".legend-value").inner_text().removeprefix("here "))
    young = page.evaluate(f"studio.view.material.young[{vertex}]")
    assert float(here) == pytest.approx(young / 1e9, rel=0.06)


def test_nothing_is_drawn_while_nothing_moves(page):
    direction(page)
    until_still(page)
    before = page.evaluate("studio.view.drawing.drawings")
    page.wait_for_timeout(400)
    assert page.evaluate("studio.view.drawing.drawings") == before


def test_every_vertex_that_is_seen_is_picked_at_its_pixel(page):
    for vertex, x, y in seen(page):
        assert page.evaluate(f"studio.view.pick({x}, {y})") == vertex


def test_a_press_on_the_solid_strikes_at_once(page):
    vertex, x, y = seen(page, 4)[0]
    page.mouse.move(x, y)
    page.mouse.down()
    assert strikes(page) == [[vertex, 1]]
    page.mouse.up()
    page.get_by_label("Strength", exact=False).first.fill("0.4")
    other, x, y = seen(page, 4)[1]
    before = direction(page)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 60, y + 20, steps=4)
    page.mouse.up()
    assert strikes(page)[1:] == [[other, 0.4]]
    assert np.allclose(direction(page), before)  # a press on the solid does not turn it


def test_background_and_right_button_turn(page):
    before = direction(page)
    x, y = beside(page)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 80, y, steps=5)
    page.mouse.up()
    turned = direction(page)
    assert np.linalg.norm(turned - before) > 0.1 * np.linalg.norm(before)
    _, x, y = seen(page, 4)[0]
    page.mouse.move(x, y)
    page.mouse.down(button="right")
    page.mouse.move(x - 80, y, steps=5)
    page.mouse.up(button="right")
    assert np.linalg.norm(direction(page) - turned) > 0.1 * np.linalg.norm(before)
    page.mouse.wheel(0, -300)
    assert np.linalg.norm(direction(page)) < 0.97 * np.linalg.norm(before)
    assert strikes(page) == []


def test_two_fingers_turn_and_one_strikes(browser):
    with serving(ToldStudio()) as address:
        page = open_page(browser, address, has_touch=True)
        vertex, x, y = seen(page, 4)[0]
        touch = page.context.new_cdp_session(page)

        def send(kind, *points):
            places = [{"x": a, "y": b, "id": n} for n, (a, b) in enumerate(points)]
            touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": places})

        send("touchStart", (x, y))
        assert strikes(page) == [[vertex, 1]]
        before = direction(page)
        send("touchStart", (x, y), (x + 60, y))
        send("touchMove", (x + 40, y), (x + 140, y))
        send("touchEnd")
        assert np.linalg.norm(direction(page) - before) > 0.05 * np.linalg.norm(before)
        assert len(strikes(page)) == 1
        page.context.close()


def test_pen_pressure_and_holding_give_the_strength(page):
    vertex, x, y = seen(page, 4)[0]
    pen = page.context.new_cdp_session(page)
    for kind, force in (("mousePressed", 0.25), ("mouseReleased", 0.0)):
        event = {"x": x, "y": y, "button": "left", "clickCount": 1, "pointerType": "pen"}
        pen.send("Input.dispatchMouseEvent", {"type": kind, "force": force, **event})
    assert strikes(page) == [[vertex, 0.25]]
    page.get_by_label("by holding").check()
    page.evaluate("window.clock = 0; performance.now = () => window.clock")
    for seconds, strength in ((0.4, 0.525), (0.9, 1.0)):
        page.mouse.move(x, y)
        page.mouse.down()
        assert page.locator(".gauge").is_visible()
        before = len(strikes(page))
        page.evaluate(f"window.clock += {1000 * seconds}")
        page.mouse.up()
        assert strikes(page)[before:] == [[vertex, pytest.approx(strength)]]
        assert not page.locator(".gauge").is_visible()
    page.evaluate("delete performance.now")


def test_keys_strike_again_and_strike_the_target(page, studio):
    vertex, x, y = seen(page, 4)[0]
    page.mouse.click(x, y)
    page.keyboard.press("3")
    page.keyboard.press("9")
    assert strikes(page)[1:] == [[vertex, pytest.approx(1 / 3)], [vertex, 1]]
    page.locator("body").press("Enter")
    assert strikes(page)[3] == [studio.state()["targets"][0]["vertex"], 1]
    name = page.locator("#panel-targets").get_by_label("Name", exact=True)
    name.fill("4")
    name.press("5")
    assert len(strikes(page)) == 4  # typing is typing


def test_the_view_is_used_by_keys_alone(page, studio):
    canvas = page.locator("#view canvas")
    canvas.focus()
    page.keyboard.press("Tab")
    page.keyboard.press("Shift+Tab")
    assert page.locator(".crosshair").is_visible()
    middle = page.evaluate(f"(({{ x, y }}) => studio.view.pick(x, y))({MIDDLE})")
    page.keyboard.press(" ")
    assert strikes(page) == [[middle, 1]]
    start = direction(page)
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowUp")
    assert np.linalg.norm(direction(page) - start) > 0.05 * np.linalg.norm(start)
    page.keyboard.press("+")
    assert np.linalg.norm(direction(page)) < 0.95 * np.linalg.norm(start)
    page.keyboard.press("Shift+ArrowDown")
    page.keyboard.press("Home")
    assert direction(page) == pytest.approx(start, rel=1e-3)
    page.keyboard.press("t")
    page.keyboard.press("Escape")  # nothing selected: what is placed is added
    page.keyboard.press(" ")
    until(lambda: len(studio.state()["targets"]) == 2)
    assert studio.state()["targets"][1]["vertex"] == middle


def test_placing_adds_a_target_or_moves_the_selected_one(page, studio):
    page.get_by_role("button", name="Place target").click()
    (moved, x, y), (added, other_x, other_y) = seen(page, 4)[:2]
    assert "rim moves there" in page.locator(".stage-hint").inner_text()
    page.mouse.click(x, y)
    until(lambda: studio.state()["targets"][0]["vertex"] == moved)
    page.get_by_role("button", name="Add another").click()
    page.mouse.click(other_x, other_y)
    until(lambda: len(studio.state()["targets"]) == 2)
    target = studio.state()["targets"][1]
    assert target["vertex"] == added
    until_page(page, f"studio.selection.current.target === {target['name']!r}")
    assert strikes(page) == []
    page.locator("button.mark", has_text="rim").click()
    until_page(page, "studio.selection.current.target === 'rim'")
    arrow = page.evaluate(
        """() => {
          const { marks, drawing } = studio.view;
          const mesh = marks.marks.get("rim").mesh;
          const at = drawing.projected(mesh.localToWorld(mesh.position.clone().set(0, 0, -0.3)));
          const box = drawing.canvas.getBoundingClientRect();
          studio.selection.set({ target: null, tool: "strike" });
          return [at.x + box.left, at.y + box.top];
        }"""
    )
    page.mouse.click(*arrow)
    until_page(page, "studio.selection.current.target === 'rim'")
    assert strikes(page) == []


DROP = """([x, y, name, content, type]) => {
  const data = new DataTransfer();
  data.items.add(new File([content], name, { type }));
  const at = document.elementFromPoint(x, y);
  for (const kind of ["dragover", "drop"]) {
    at.dispatchEvent(new DragEvent(kind, {
      dataTransfer: data, clientX: x, clientY: y, bubbles: true, cancelable: true }));
  }
}"""


def test_files_are_dropped(page, studio):
    vertex, x, y = seen(page, 4)[0]
    page.evaluate(DROP, [x, y, "ding.wav", "RIFF", "audio/wav"])
    call = until(lambda: next((c for c in studio.calls if c[0] == "add_target"), None))
    assert call[1] == {"vertex": vertex, "clip": "c2"}
    page.evaluate(DROP, [1200, 780, "dong.wav", "RIFF", "audio/wav"])
    # The new target is the selected one.
    page.get_by_role("button", name="Replace by dong.wav").click()
    call = until(lambda: next((c for c in studio.calls if c[0] == "change_target"), None))
    assert call[1] == {"target": "target 2", "clip": "c3"}
    page.evaluate(DROP, [x, y, "dang.wav", "RIFF", "audio/wav"])
    page.get_by_role("button", name="Keep dong.wav").click()
    page.evaluate(DROP, [x, y, "cup.stl", "solid", ""])
    dialog = page.get_by_role("dialog", name="Open cup.stl")
    dialog.get_by_label("One unit of the file").select_option(label="mm")
    dialog.get_by_role("button", name="Open").click()
    call = until(lambda: next((c for c in studio.calls if c[0] == "open_mesh"), None))
    assert call[1] == {"mesh": "m4", "unit": 0.001}
    page.evaluate(DROP, [x, y, "ding.wav", "none", "audio/wav"])
    until(lambda: "expected WAV" in page.locator("#messages").inner_text())
    page.evaluate(DROP, [x, y, "letter.pdf", "none", ""])
    until(lambda: "expected a mesh" in page.locator("#messages").inner_text())


def test_an_empty_page_says_what_to_do(browser):
    studio = ToldStudio()
    studio.told = {"solid": None, "targets": [], "clips": [], "wanted": None}
    with serving(studio) as address:
        page = open_page(browser, address, "!!document.querySelector('.empty .choices button')")
        page.get_by_role("button", name="recorded-bell").press("Enter")
        until(lambda: ("open_project", {"project": "e1"}) in studio.calls)
        page.locator(".empty").get_by_role("button", name="frying-pan").click()
        until(lambda: ("open_mesh", {"mesh": "builtin:frying-pan", "unit": 1}) in studio.calls)
        page.locator(".empty select").select_option("0.001")
        page.locator(".empty input[type=file]").set_input_files(
            {"name": "cup.obj", "mimeType": "model/obj", "buffer": b"v 0 0 0"}
        )
        until(lambda: ("open_mesh", {"mesh": "m1", "unit": 0.001}) in studio.calls)
        page.context.close()


def test_preparation_and_failure_are_told(page, studio):
    solid = studio.state()["solid"]
    studio.tell(solid={**solid, "phase": "preparing", "progress": 0.4, "message": "Voxels"})
    bar = page.locator(".notices progress")
    until(lambda: bar.is_visible())
    assert bar.evaluate("(bar) => bar.value") == pytest.approx(0.4)
    assert "Voxels" in page.locator("#progress-says").inner_text()
    studio.tell(solid={**solid, "phase": "failed", "message": "cup.stl: is not closed."})
    until(lambda: not bar.is_visible())
    assert page.locator(".notice.fault").inner_text().startswith("cup.stl: is not closed.")
    page.locator(".notice.fault button").click()
    assert page.get_by_role("dialog", name="Open").is_visible()
    page.keyboard.press("Escape")
    assert not page.get_by_role("dialog", name="Open").is_visible()


def test_graphics_that_are_lost_come_back(page):
    page.evaluate(
        """() => {
          const context = studio.view.drawing.renderer.getContext();
          window.loss = context.getExtension("WEBGL_lose_context");
          window.loss.loseContext();
        }"""
    )
    notice = page.locator(".notice.graphics")
    until(lambda: notice.is_visible())
    assert "graphics" in notice.inner_text()
    page.evaluate("window.loss.restoreContext()")
    until(lambda: not notice.is_visible())
    assert pixels(page).std() > 10.0


NO_GRAPHICS = "HTMLCanvasElement.prototype.getContext = () => null;"


def test_without_graphics_targets_are_struck(browser):
    with serving(studio := ToldStudio()) as address:
        page = open_page(browser, address, "window.studio?.bank?.current", NO_GRAPHICS)
        assert "WebGL" in page.locator(".notice.graphics").inner_text()
        page.locator("body").press("Enter")
        assert strikes(page) == [[studio.state()["targets"][0]["vertex"], 1]]
        page.context.close()


def test_a_large_solid_is_drawn_and_picked(browser):
    sphere = trimesh.creation.icosphere(subdivisions=6, radius=0.05)  # 81,920 triangles
    with serving(ToldStudio(sphere)) as address:
        page = open_page(browser, address)
        for vertex, x, y in seen(page, 10):
            assert page.evaluate(f"studio.view.pick({x}, {y})") == vertex
        page.context.close()


@pytest.mark.parametrize("width", [360, 1280])
def test_nothing_overflows(browser, width):
    with serving(ToldStudio()) as address:
        page = open_page(browser, address, viewport={"width": width, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        page.context.close()


def test_edges_are_shaded_as_edges(page):
    cube = trimesh.creation.box()
    told = page.evaluate(
        """async ([positions, triangles]) => {
          const { creased } = await import("/page/solid/surface.js");
          const { sources, normals } =
            creased(Float32Array.from(positions), Uint32Array.from(triangles));
          return { sources: [...sources], normals: [...normals] };
        }""",
        [cube.vertices.ravel().tolist(), cube.faces.ravel().tolist()],
    )
    assert sorted(told["sources"]) == sorted(3 * list(range(8)))
    normals = np.reshape(told["normals"], (-1, 3))
    assert np.allclose(np.sort(np.abs(normals), axis=1), [0, 0, 1], atol=1e-6)
