"""What objects show in a notebook: whole, small, without a network, and never an exception."""

import base64
import io
import json
import re
import zlib
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest
import soundfile

import carillon as ca
from carillon.drawing.solid import guess_up
from carillon.fem.geometry.turning import upright_rotation
from carillon.notebook.card import html_or_text
from carillon.notebook.solid import _program as viewer_program
from carillon.notebook.solid import solid
from carillon.notebook.triangles import MOST_TRIANGLES, STEPS, Triangles
from sound.levels import dithered
from tests.notebooks import HEAD
from tests.programs import CHECKOUT, python
from tests.small_design import small_design

VOID = {"img", "br", "meta", "link"}
"""Elements without an end."""
EVIL = "<script>alert('a \"bell\"')</script>&amp;"
LARGEST = 250_000
"""Bytes of what shows a solid."""


class Page(HTMLParser):
    """Reads HTML, and fails where an element is not closed in its place."""

    def __init__(self, text: str):
        super().__init__()
        self.open: list[str] = []
        self.seen: list[tuple[str, dict[str, str | None]]] = []
        self.text, self.scripts = "", []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if "script" in self.open:
            self.scripts.append("viewer" if data == viewer_program() else data)
        elif "style" not in self.open:
            self.text += data

    def all(self, tag):
        return [attributes for name, attributes in self.seen if name == tag]


@pytest.fixture(scope="module")
def solution() -> ca.Solution:
    return ca.solve("builtin:bar", "two-region", resolution=12, modes=12)


@pytest.fixture(scope="module")
def objects(solution):
    """One of each that shows itself, by a name for the test's messages."""
    brass = ca.Material.named("brass")
    cells = ca.solve("builtin:plate", brass, resolution=8, modes=9, discretisation="finite-cell")
    clip = 0.3 * np.exp(-np.arange(4000) / 800) * np.sin(0.3 * np.arange(4000))
    return {
        "mesh": ca.load_mesh("builtin:bell"),
        "wall": ca.load_mesh("builtin:box", wall="4 mm"),
        "solution": solution,
        "one mode": ca.solve("builtin:bar", brass, resolution=6, modes=7),
        "held": ca.solve("builtin:bar", brass, resolution=8, modes=8, fix="x < -0.1"),
        "cells": cells,
        "voxels": solution.solid,
        "coarse": ca.coarsen("builtin:bar", "two-region", resolution=12),
        "of cells": cells.solid,
        "comparison": ca.compare(solution, solution),
        "audit": ca.audit(solution),
        "estimate": ca.estimate(cells),
        "sound": ca.Sound(ca.render(solution, solution.mesh.nodes[0], seconds=0.5)),
        "stereo": ca.Sound(np.stack([clip, 0.5 * clip], axis=1), 8000),
        "silence": ca.Sound(np.zeros(10)),
        "modes of a clip": ca.extract(ca.Sound(clip, 8000)),
        "design": ca.Design(small_design()),
    }


def requests(page: Page) -> list[str]:
    """Addresses that a page loads, but for what it holds itself."""
    named = ("src", "href", "data", "srcset", "poster", "action", "xlink:href")
    found = [each[name] or "" for _, each in page.seen for name in named if name in each]
    return [address for address in found if not address.startswith("data:")]


def test_html_is_well_formed_whole_and_light(objects):
    for name, shown in objects.items():
        html = shown._repr_html_()
        page = Page(html)
        assert "no picture" not in html, name
        assert requests(page) == [] and not re.search(r"https?:|@import|url\(", html), name
        size = len(html) - sum(len(each["src"]) for each in page.all("audio"))
        assert size < LARGEST, name
        assert not any(key.startswith("on") for _, each in page.seen for key in each), name


def test_elsewhere_each_is_one_line(objects):
    others = [
        ca.Material(),
        ca.Material([1e9, 2e9]),
        ca.Material(regions=[ca.Region("a", material="iron"), ca.Region("b", young=1e9)]),
        ca.Forests.load(),
        objects["voxels"].mesh,
    ]
    for shown in (*objects.values(), *others):
        line = repr(shown)
        assert "\n" not in line and 10 < len(line) < 160 and line[0] + line[-1] == "<>", line


def test_the_same_object_shows_the_same(objects):
    for shown in objects.values():
        assert shown._repr_html_() == shown._repr_html_()


def test_names_are_escaped(tmp_path):
    mesh = ca.load_mesh("builtin:box")
    named = ca.Mesh(mesh.surface, EVIL)
    design = small_design()
    design.settings = {**design.settings, "mesh": f"{EVIL}.obj"}
    design.evidence = {"verdict": {"sentence": EVIL}}
    for shown in (named, ca.Design(design)):
        page = Page(shown._repr_html_())
        assert EVIL[1:20] in page.text
        assert page.scripts == ["viewer"]
    assert "<script>alert" not in named._repr_html_()


def test_a_sound_is_played_as_it_is(objects):
    for name in ("sound", "stereo"):
        shown = objects[name]
        (player,) = Page(shown._repr_html_()).all("audio")
        content = base64.b64decode(player["src"].partition("base64,")[2])
        samples, rate = soundfile.read(io.BytesIO(content), dtype="int16")
        assert rate == shown.rate
        assert np.array_equal(samples, dithered(shown.samples, 16))
        # Half a step of rounding, and a step of dither.
        assert np.abs(samples / 2.0**15 - shown.samples).max() <= 1.5 / 2.0**15


def test_what_a_player_changes_is_written_above_it():
    loud = ca.Sound(3.0 * np.sin(np.arange(8000)), 8000)
    assert "beyond full scale" in loud._repr_html_()
    long = ca.Sound(np.zeros(8000 * 25), 8000)
    html = long._repr_html_()
    assert "the first 20 s" in html and "25 s at 8,000 Hz" in html


def test_what_fails_leaves_the_text(solution, monkeypatch):
    assert html_or_text("<a>", lambda: 1 / 0) == (
        "<pre>&#x27;&lt;a&gt;&#x27;</pre><p>no picture: division by zero</p>"
    )
    other_rank = ca.Solution(
        solution.eigenvalues, solution.frequencies, solution.residuals, None, None
    )
    assert "&lt;Solution: 12 modes" in other_rank._repr_html_()

    def failing(*_):
        raise RuntimeError("out of <memory>")

    monkeypatch.setattr("carillon.notebook.solid.still_png", failing)
    for shown in (solution, solution.solid, ca.load_mesh("builtin:bar")):
        assert "no picture: out of &lt;memory&gt;" in shown._repr_html_()


def unpacked(html: str) -> SimpleNamespace:
    """What the viewer reads: places (v, 3), values (v,), faces (t, 3) and motions (v, 3)."""
    (host,) = [each for each in Page(html).all("div") if "data-view" in each]
    told = json.loads(host["data-view"])
    content, end = zlib.decompress(base64.b64decode(host["data-content"])), 0

    def following(count: int, kind: str) -> np.ndarray:
        nonlocal end
        read = np.frombuffer(content, kind, count, end)
        end += read.nbytes
        return read

    v, t = told["vertices"], told["triangles"]
    places = following(3 * v, "<u2").reshape(-1, 3) / STEPS * 2.0 - 1.0
    values = following(v, "<u2") / STEPS if told["values"] else None
    faces = following(3 * t, "<u2").reshape(-1, 3)
    motions = [following(3 * v, "i1").reshape(-1, 3) / 127.0 for _ in told["motions"]]
    assert end == len(content)
    return SimpleNamespace(places=places, values=values, faces=faces, motions=motions)


def area(places: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (places[faces[:, n]] for n in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0)


def test_the_viewer_has_the_shape_of_the_solid():
    mesh = ca.load_mesh("builtin:bell")
    shown = unpacked(mesh._repr_html_())
    radius = np.linalg.norm(mesh.vertices - mesh.surface.bounds.mean(axis=0), axis=1).max()
    assert np.isclose(area(shown.places, shown.faces) * radius**2, mesh.surface.area, rtol=1e-3)
    assert np.abs(np.linalg.norm(shown.places, axis=1)).max() <= 1.0 + 1e-4


def test_motions_are_those_of_the_modes(solution):
    shown = unpacked(solution._repr_html_())
    for motion, shape in zip(shown.motions, solution.shapes[6:]):
        assert np.isclose(np.linalg.norm(motion, axis=1).max(), 1.0, atol=0.01)
        own = shape @ upright_rotation(guess_up(solution.mesh)).T
        own /= np.linalg.norm(shape, axis=1).max()
        # Each motion that is drawn is that of some node; a byte rounds by half a step of 127.
        apart = np.linalg.norm(motion[:, None] - own[None], axis=2).min(axis=1)
        assert apart.max() < 0.5 * np.sqrt(3.0) / 127.0 + 1e-6


def test_large_surfaces_are_shown_by_few_triangles():
    import trimesh

    sphere = trimesh.creation.icosphere(6)
    assert len(sphere.faces) > 5 * MOST_TRIANGLES
    shown = Triangles.of_surface(sphere.vertices, sphere.faces)
    assert MOST_TRIANGLES / 3 < len(shown.faces) <= MOST_TRIANGLES
    assert np.isclose(area(shown.places, shown.faces), 4.0 * np.pi, rtol=0.02)
    assert len(solid(shown, "sphere").html) < LARGEST


def test_each_motion_has_a_name():
    shown = Triangles.of_corners(np.eye(3)[None], motions=[np.ones((1, 3, 3))])
    with pytest.raises(ValueError, match="0 names for 1 motions"):
        solid(shown, "triangle")


def test_nothing_is_loaded_before_it_is_shown():
    program = (
        "import sys, carillon as ca; s = ca.solve('builtin:bar', resolution=6, modes=7); repr(s);"
        "print(*sys.modules); s._repr_html_(); print(*sys.modules)"
    )
    before, after = (set(line.split()) for line in python("-c", program).stdout.splitlines())
    drawn = {"matplotlib", "pyvista", "vtk", "IPython", "carillon.notebook.solid"}
    assert before.isdisjoint(drawn)
    assert after & drawn == {"carillon.notebook.solid"}


def test_pyvista_that_is_missing_is_named_with_what_installs_it(solution, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pyvista", None)
    for call in (
        lambda: solution.plot(7, by="pyvista"),
        solution.to_pyvista,
        ca.load_mesh("builtin:bar").to_pyvista,
    ):
        with pytest.raises(ca.UserError) as caught:
            call()
        assert str(caught.value).endswith("pip install -r workflow/envs/requirements-vtk.txt")


def test_a_picture_is_shown_and_written_without_pyplot(solution, tmp_path):
    figure = solution.plot(7, tmp_path / "bar.png")
    png = b"\x89PNG\r\n\x1a\n"
    assert figure._repr_png_()[:8] == (tmp_path / "bar.png").read_bytes()[:8] == png
    with pytest.raises(ca.UserError, match="a.txt: not written"):
        solution.plot(7, tmp_path / "a.txt")
    assert [each.name for each in tmp_path.iterdir()] == ["bar.png"]
    with pytest.raises(ca.UserError, match="by: found 'vtk', expected 'matplotlib' or 'pyvista'"):
        solution.plot(7, by="vtk")


def test_sounds_are_read_and_written(tmp_path):
    tone = ca.Sound(0.5 * np.sin(2.0 * np.pi * 997.0 * np.arange(48_000) / 48_000), 48_000)
    tone.save(tmp_path / "tone.wav")
    read = ca.Sound.load(tmp_path / "tone.wav")
    assert read.rate == tone.rate and np.array_equal(read.samples, tone.samples.astype("f4"))
    assert tone.seconds == 1.0 and round(tone.loudness, 2) == -9.03  # BS.1770: -3.01 of a full sine
    assert np.array_equal(np.asarray(tone), tone.samples)
    for samples, rate in (([], 48_000), ([np.nan], 48_000), (["a"], 48_000), ([0.0], 5)):
        with pytest.raises(ca.UserError):
            ca.Sound(samples, rate)
    with pytest.raises(ca.UserError, match="2 samples of 100 channels.*transpose"):
        ca.Sound(np.zeros((2, 100)))


@pytest.fixture(scope="module")
def page(objects, tmp_path_factory):
    """A page with all that is shown, in a file."""
    path = tmp_path_factory.mktemp("page") / "page.html"
    parts = "".join(shown._repr_html_() for shown in objects.values())
    path.write_text(f"{HEAD}{parts}</body></html>", encoding="utf-8")
    return path


@pytest.mark.parametrize("width", [1280, 390])
def test_a_browser_draws_and_turns_solids(browser, page, width):
    tab = browser.new_page(viewport={"width": width, "height": 800})
    faults: list[str] = []
    tab.on("pageerror", lambda error: faults.append(str(error)))
    tab.on(
        "console", lambda message: faults.append(message.text) if message.type == "error" else None
    )
    asked: list[str] = []
    tab.on("request", lambda request: asked.append(request.url))
    tab.goto(page.as_uri())
    solids = tab.locator(".carillon-solid")
    tab.wait_for_function(
        "n => document.querySelectorAll('.carillon-solid canvas').length === n", arg=solids.count()
    )
    assert tab.locator(".carillon-solid img").count() == 0
    assert tab.evaluate("document.documentElement.scrollWidth") <= width
    canvas = solids.first.locator("canvas")
    picture = "() => document.querySelector('.carillon-solid canvas').toDataURL()"
    tab.wait_for_function(f"({picture})().length > 3000")  # An empty one is shorter.
    before = tab.evaluate(picture)
    canvas.focus()
    tab.keyboard.press("ArrowRight")
    tab.wait_for_function(f"before => ({picture})() !== before", arg=before)
    pressed = tab.get_by_role("button", name="mode 8", exact=True).first
    pressed.click()
    assert pressed.get_attribute("aria-pressed") == "true"
    assert [url for url in asked if not url.startswith(("file:", "data:"))] == []
    assert faults == []
    tab.close()


def test_where_no_program_runs_the_picture_stays(browser, page):
    context = browser.new_context(java_script_enabled=False)
    tab = context.new_page()
    tab.goto(page.as_uri())
    assert tab.locator(".carillon-solid img").count() == tab.locator(".carillon-solid").count() > 5
    context.close()


def test_the_viewer_draws_as_the_still_picture_does():
    """Both have the same eye, zoom, amplitude and colours."""
    from carillon.notebook import still

    program = (CHECKOUT / "carillon" / "notebook" / "viewer.js").read_text()
    numbers = (still.WIDTH, still.HEIGHT, still.DISTANCE, still.ZOOM, still.DRAWN_AMPLITUDE)
    assert f"AMPLITUDE] = [{', '.join(f'{number:g}' for number in numbers)}]" in program
    assert f"azimuth: {still.AZIMUTH:g}, elevation: {still.ELEVATION:g}" in program
    for colour in (*still.COLOURS, still.PLAIN):
        assert f"vec3{colour}" in program
