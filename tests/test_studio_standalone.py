"""The page of a design that needs no server: it opens from a file, and sounds as the design."""

import base64
import io
import re
from dataclasses import replace

import numpy as np
import pytest

from carillon.errors import UserError
from sound.rendering.listening import Listening
from sound.rendering.render import Hit, render
from sound.rendering.solid import SoundingSolid
from sound.synthesis.sinusoids import Bank, ring
from studio.binary import unpack
from studio.standalone import write_page
from studio.standalone.content import GAIN_ERROR, STEPS, content
from studio.standalone.page import HERE, MANY_TRIANGLES, PAGE, gathered, joined, shortened
from tests.small_design import N_MODES, small_design
from tests.studio_pages import axe_finds, until_page

pytestmark = pytest.mark.nightly(unless=("studio", "sound"))

RATE = 44_100
HOSTILE = "</script><script>window.broken = true</script><img src=x onerror='window.broken = 1'>"
PACKED = """(samples) => {
  let text = "";
  for (const byte of new Uint8Array(samples.buffer)) text += String.fromCharCode(byte);
  return btoa(text);
}"""


def opened(browser, path):
    """The page of a file, without a network, and what it asked for."""
    page = browser.new_context(viewport={"width": 1000, "height": 700}, offline=True).new_page()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: pytest.fail(str(error)))
    page.goto(path.as_uri())
    page.wait_for_selector("#spectrum svg")
    page.evaluate("() => window.standalone.bank.ready")
    return page, asked


def samples(page, expression: str) -> np.ndarray:
    """Samples that an expression of the page gives."""
    packed = page.evaluate(f"async () => ({PACKED})({expression})")
    return np.frombuffer(base64.b64decode(packed), "<f4").astype(float)


def decibels(found: np.ndarray, truth: np.ndarray) -> float:
    return 20 * np.log10(float(np.linalg.norm(found - truth)) / float(np.linalg.norm(truth)))


def test_opens_from_a_file_and_sounds_as_the_design(browser, tmp_path):
    design, path = small_design(), tmp_path / "page.html"
    quieter = replace(design.targets, amplitudes=0.5 * design.targets.amplitudes)
    design = replace(design, targets=quieter)
    write_page(path, design)
    page, asked = opened(browser, path)
    assert page.evaluate("window.standalone.bank.failure") is None
    solid = SoundingSolid.of_design(design)
    listening = Listening.of_design(design, solid)
    for number, strike in enumerate(design.strikes):
        hit = Hit(0.0, strike.position, strike.inward)
        truth = render(solid, [hit], 0.3, RATE, listening=listening, residual=False)
        assert np.abs(truth).max() < 1.0
        call = f"await window.standalone.render({strike.vertex}, 0.3, {RATE})"
        assert decibels(samples(page, call), truth) < -60.0
        rate = page.evaluate("window.standalone.bank.context.sampleRate")
        call = f"(await window.standalone.clip({number})).getChannelData(0)"
        clip = samples(page, call)
        targets = design.targets
        bank = Bank(targets.frequencies, targets.dampings, rate)
        truth = ring(bank, [(0.0, targets.amplitudes[number])], len(clip))
        inside = np.abs(truth).max() < 1.0
        assert not inside or decibels(clip, truth) < -120.0
    assert all(url.startswith(("file:", "blob:", "data:")) for url in asked)
    assert sum(url.startswith("file:") for url in asked) == 1
    page.context.close()


def test_is_struck_by_pointer_and_keys(browser, tmp_path):
    path = tmp_path / "page.html"
    write_page(path, small_design())
    page, _ = opened(browser, path)
    page.evaluate(
        "() => { window.struck = []; window.standalone.bank.onStrike((s) => struck.push(s)); }"
    )
    box = page.locator("#view canvas").bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.keyboard.press("3")
    page.get_by_role("button", name="side", exact=True).first.click()
    page.locator("#view canvas").focus()
    page.keyboard.press("Enter")
    page.get_by_role("group", name="Listen at corner").get_by_role("button", name="Design").click()
    struck = until_page(page, "window.struck.length === 4 && window.struck")
    assert [round(each["strength"], 3) for each in struck] == [1.0, 0.333, 1.0, 1.0]
    assert struck[0]["vertex"] == struck[1]["vertex"]
    vertices = {strike.name: strike.vertex for strike in small_design().strikes}
    assert [each["vertex"] for each in struck[2:]] == [vertices["side"], vertices["corner"]]
    # Struck anew as often as it is looked at, since modes die away.
    looked = f"standalone.bank.strike({vertices['side']}, 1) && standalone.bank.level().ringing"
    until_page(page, f"({looked}) === {N_MODES}")
    from PIL import Image

    drawn = np.array(Image.open(io.BytesIO(page.screenshot())).convert("RGB"))
    assert len(np.unique(drawn.reshape(-1, 3), axis=0)) > 500
    page.context.close()


def test_names_are_no_markup(browser, tmp_path):
    design, path = small_design(), tmp_path / "page.html"
    strikes = [replace(each, name=f"{HOSTILE}{n}") for n, each in enumerate(design.strikes)]
    settings = {**design.settings, "mesh": HOSTILE}
    write_page(path, replace(design, strikes=strikes, settings=settings))
    text = path.read_text(encoding="utf-8")
    assert HOSTILE not in text and "window.broken" not in text.replace("\n", "")
    page, _ = opened(browser, path)
    page.wait_for_timeout(200)
    assert page.evaluate("typeof window.broken") == "undefined"
    assert f"{HOSTILE}1" in page.inner_text("#targets")
    page.context.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_serious(browser, tmp_path, scheme):
    path = tmp_path / "page.html"
    write_page(path, small_design())
    page, _ = opened(browser, path)
    page.emulate_media(color_scheme=scheme)
    for summary in page.locator("summary").all():
        summary.click()
    assert axe_finds(page) == []
    page.context.close()


def test_holds_what_it_says_to_a_stated_error():
    design = small_design()
    header, arrays = unpack(content(design))
    solid = SoundingSolid.of_design(design)
    listening = Listening.of_design(design, solid)
    low, high = arrays["halves"].view("u1").reshape(2, -1)
    shares = np.column_stack([low, high]).ravel().view("<f2").astype(float).reshape(N_MODES, -1).T
    gains = shares * arrays["loudest"]
    for strike in design.strikes:
        amplitudes = solid.amplitudes(strike.position[None], strike.inward[None])[0]
        truth = amplitudes * listening.gain(strike.position)
        loud = truth > arrays["loudest"] / 16_000.0
        np.testing.assert_allclose(gains[strike.vertex][loud], truth[loud], rtol=GAIN_ERROR)
    places = np.array(header["origin_m"]) + arrays["places"].T * header["step_m"]
    side = np.ptp(design.surface_vertices, axis=0).max()
    np.testing.assert_allclose(places, design.surface_vertices, atol=0.51 * side / STEPS)
    low, step = header["young_log10_pa"]
    young = 10.0 ** (low + step * arrays["young"])
    assert design.young.min() * 0.999 < young.min() and young.max() < design.young.max() * 1.001
    np.testing.assert_array_equal(arrays["hertz"], design.frequencies)
    np.testing.assert_array_equal(arrays["triangles"], design.surface_faces)


def test_many_triangles_are_told(tmp_path, capsys):
    import trimesh

    design = small_design()
    write_page(tmp_path / "small.html", design)
    assert capsys.readouterr().err == ""
    surface = trimesh.Trimesh(design.surface_vertices, design.surface_faces, process=False)
    while len(surface.faces) <= MANY_TRIANGLES:
        surface = surface.subdivide()
    fine = replace(
        design,
        surface_vertices=np.array(surface.vertices),
        surface_faces=np.array(surface.faces),
    )
    write_page(tmp_path / "large.html", fine)
    said = capsys.readouterr().err
    assert f"{len(surface.faces):,} triangles" in said and "MB" in said


def test_what_cannot_be_written_is_told(tmp_path):
    with pytest.raises(UserError, match="nowhere"):
        write_page(tmp_path / "nowhere" / "page.html", small_design())


def test_modules_name_each_other_by_numbers():
    modules = gathered(HERE / "main.js")
    named = re.compile(r"""\b(?:from|import)\s*\(?\s*["']([\w./@-]+)["']""")
    for source in modules.values():
        assert all(name in modules for name in named.findall(source))
    assert "export async function start" in list(modules.values())[-1]


def test_a_worklet_is_one_module():
    source = joined(PAGE / "sound/bank-processor.js")
    assert not re.search(r"^(?:import|export)\b", source, re.M)
    # Those of its own level: classes, functions, and constants in capitals.
    names = re.findall(r"^(?:class|function|const(?= [A-Z_]+ )) (\w+)", source, re.M)
    assert {"Bank", "Limiter", "BankProcessor"} <= set(names) and len(names) == len(set(names))


def test_licences_stay():
    source = (PAGE / "vendor/three/three.core.js").read_text()
    assert "@license" in shortened(source)
    assert len(shortened(source)) < 0.6 * len(source)
