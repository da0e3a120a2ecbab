"""The page of a scene that needs no server: what is seen and heard agree, and it is struck."""

import base64
import io
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import soundfile
import trimesh

from carillon.errors import UserError
from sound.scenes.performance import (
    GROUND,
    Appearance,
    Camera,
    Impact,
    Motion,
    Performance,
    Picture,
    Voice,
)
from studio.binary import unpack
from studio.scene import page, write_scene_page
from studio.scene.page import GROUND_ON_PAGE, LOUDEST_STRIKE, QUIETEST_STRIKE, content, flac
from studio.standalone.content import GAIN_ERROR, STEPS
from tests.chromium import ARGUMENTS, CHECKOUT, PROGRAMS, served
from tests.strike_latency import TAP_ADDRESS
from tests.studio_pages import axe_finds, until_page
from tests.test_studio_standalone import HOSTILE, samples

pytestmark = pytest.mark.nightly(unless=("studio", "sound"))

FRAME = 1.0 / 60.0
RATE = 44_100
SECONDS = 2.5
STEPS_PER_SECOND = 120
RADIUS = 0.05
DROP = 0.3
GRAVITY = 9.81
BOUNCE = 0.75
LEFT, DRIFT = -0.16, 0.04
BALL, BLOCK, CONE = range(3)


def bounces(seconds: float) -> list[tuple[float, float]]:
    """When a ball that is let go strikes the ground, and with what speeds."""
    speed = np.sqrt(2.0 * GRAVITY * DROP)
    found = [(speed / GRAVITY, speed)]
    while speed > 0.1:
        speed *= BOUNCE
        found.append((found[-1][0] + 2.0 * speed / GRAVITY, speed))
    return [each for each in found if each[0] < seconds]


def heights(times: np.ndarray) -> np.ndarray:
    """Heights of the ball above where it rests."""
    found = DROP - GRAVITY * times**2 / 2.0
    for begin, speed in bounces(SECONDS):
        since = times - begin
        flight = np.maximum(0.0, BOUNCE * speed * since - GRAVITY * since**2 / 2.0)
        found = np.where(since >= 0.0, flight, found)
    return found


def clicks() -> np.ndarray:
    """Sound that begins at once with each impact."""
    sound = np.zeros((int(SECONDS * RATE), 2))
    for seconds, speed in bounces(SECONDS):
        first = round(seconds * RATE)
        since = np.arange(min(RATE // 2, len(sound) - first)) / RATE
        ring = 0.25 * speed * np.exp(-30.0 * since) * np.cos(2.0 * np.pi * 880.0 * since)
        sound[first : first + len(since)] += ring[:, None] * [0.5, 0.35]
    return sound


def voice(vertices: int, frequencies: list[float], seed: int) -> Voice:
    gains = np.random.default_rng(seed).uniform(0.5, 2.0, (vertices, len(frequencies)))
    # They ring for as long as it may take until anybody looks.
    return Voice(np.array(frequencies), 0.4 + np.array(frequencies) / 2000.0, gains)


def performance(names: tuple[str, ...] = ("ball", "block", "cone")) -> Performance:
    """A ball that bounces beside a block and a cone that is silent."""
    block = trimesh.creation.box((0.16, 0.1, 0.06)).subdivide().subdivide().subdivide()
    cone = trimesh.creation.cone(0.045, 0.12, sections=48)
    cone.apply_translation(-cone.center_mass)
    meshes = (trimesh.creation.icosphere(3, RADIUS), block, cone)
    colours = [(0.85, 0.33, 0.2), (0.25, 0.5, 0.72), (0.9, 0.75, 0.35)]
    objects = [
        Appearance(name, np.array(mesh.vertices), np.array(mesh.faces), colour)
        for name, mesh, colour in zip(names, meshes, colours)
    ]
    times = np.arange(int(SECONDS * STEPS_PER_SECOND) + 1) / STEPS_PER_SECOND
    positions, rotations = np.zeros((len(times), 3, 3)), np.zeros((len(times), 3, 4))
    positions[:, BALL] = [0.0, -0.02, RADIUS]
    positions[:, BALL, 0] = LEFT + DRIFT * times
    positions[:, BALL, 2] += heights(times)
    positions[:, BLOCK] = [0.05, 0.02, 0.03]
    positions[:, CONE] = [0.2, -0.06, -cone.bounds[0, 2]]
    rotations[:, BALL, 0], rotations[:, BALL, 2] = np.cos(3.0 * times), np.sin(3.0 * times)
    rotations[:, BLOCK] = [np.cos(0.2), 0.0, 0.0, np.sin(0.2)]
    rotations[:, CONE, 0] = 1.0
    camera = Camera((0.15, -0.95, 0.5), (0.02, 0.0, 0.1))
    picture = Picture(objects, Motion(times, positions, rotations), 0.0, camera)
    impacts = [
        Impact(
            seconds,
            (BALL, GROUND),
            np.array([LEFT + DRIFT * seconds, -0.02, 0.0]),
            np.array([0.0, 0.0, 0.2 * speed]),
            speed,
            3e-4,
        )
        for seconds, speed in bounces(SECONDS)
    ]
    voices = [
        voice(len(objects[BALL].vertices), [880.0, 2100.0, 3900.0], 1),
        voice(len(objects[BLOCK].vertices), [312.0, 820.0, 1550.0, 2300.0], 2),
        None,
    ]
    accuracies = [None, {"solid_frequency_error_rms": 0.012}, None]
    return Performance(
        "A ball and a block", picture, clicks(), RATE, impacts, voices, accuracies=accuracies
    )


@pytest.fixture(scope="module")
def path(tmp_path_factory) -> Path:
    """The page of the ball and the block."""
    found = tmp_path_factory.mktemp("scene") / "scene.html"
    write_scene_page(found, performance())
    return found


def opened(browser, path: Path, **options):
    """The page of a file, without a network; `asked` and `faults` are what it asked for and did."""
    window = {"viewport": {"width": 900, "height": 600}, "offline": True, **options}
    page = browser.new_context(**window).new_page()
    page.asked, page.faults = [], []
    page.on("request", lambda request: page.asked.append(request.url))
    page.on("pageerror", lambda error: page.faults.append(str(error)))
    page.on("console", lambda said: said.type == "error" and page.faults.append(said.text))
    page.goto(path.as_uri())
    page.wait_for_selector("#begin:not([hidden])")
    page.evaluate("scene.sound.ready")
    return page


@pytest.fixture
def shown(browser, path):
    """The page, open; no fault of it is passed over."""
    page = opened(browser, path)
    yield page
    page.context.close()
    assert page.faults == []


@pytest.fixture
def modules(browser):
    """An empty page, which the modules of a scene's page can be imported into."""
    with served(CHECKOUT / "studio") as address:
        page = browser.new_page()
        page.goto(address)
        yield page
        page.close()


def middle_of(page, number: int) -> tuple[float, float]:
    """Pixels of the page of the middle of a body."""
    x, y = page.evaluate(
        """(number) => {
          const { x, y } = scene.stage.projected(scene.stage.actors[number].mesh.position);
          const box = scene.stage.canvas.getBoundingClientRect();
          return [box.left + x, box.top + y];
        }""",
        number,
    )
    return x, y


def tap(page) -> None:
    """Keep in `tapped` all that `TAP_ADDRESS` tells of what is heard."""
    page.evaluate(
        """async (address) => {
          const { context } = scene.sound.bank;
          await context.audioWorklet.addModule(address);
          const tap = new AudioWorkletNode(context, "tap");
          window.tapped = [];
          tap.port.onmessage = ({ data }) => tapped.push(data);
          scene.sound.ears.connect(tap).connect(context.destination);
        }""",
        TAP_ADDRESS,
    )


def begin(page) -> None:
    page.click("#begin")
    # On a busy machine little that is left of a scene may have been played before it is looked.
    until_page(page, "scene.playback.at > 0.05 && (scene.playback.runs || !scene.playback.wanted)")


def endlessly(page) -> None:
    """Play over and over, so that the scene does not end before it is looked at."""
    page.evaluate("scene.playback.loop = true")
    begin(page)


def test_opens_from_a_file_and_asks_for_nothing(shown):
    assert shown.evaluate("scene.sound.failure") is None
    assert all(url.startswith(("file:", "blob:", "data:")) for url in shown.asked)
    assert sum(url.startswith("file:") for url in shown.asked) == 1
    assert shown.inner_text("h1") == "A ball and a block"
    bodies = shown.locator("#bodies .body").all_inner_texts()
    assert [text.split("\n") for text in bodies] == [
        ["ball", "3 modes from 880 Hz"],
        ["block", "4 modes from 312 Hz, about 21 cents off"],
        ["cone", "silent"],
    ]
    from PIL import Image

    drawn = np.array(Image.open(io.BytesIO(shown.screenshot())).convert("RGB"))
    assert len(np.unique(drawn.reshape(-1, 3), axis=0)) > 500


def test_playing_moves_bodies_to_where_they_are_at_the_time(shown):
    places = """() => [scene.playback.at, ...scene.stage.actors.map(({ mesh }) => {
      const [x, y, z, w] = mesh.quaternion.toArray();
      return [...mesh.position.toArray(), w, x, y, z];
    })]"""
    motion = performance().picture.motion
    begin(shown)
    for seconds in (0.1, 0.2, 0.4):
        until_page(shown, f"scene.playback.at > {seconds}")
        at, *found = shown.evaluate(places)
        positions, rotations = motion.at(at)
        np.testing.assert_allclose(found, np.hstack([positions, rotations]), atol=1e-6)
    assert shown.locator("#clock").inner_text().endswith("/ 2.50 s")


def test_what_is_drawn_is_what_is_heard_within_a_frame(shown):
    endlessly(shown)
    off: list[float] = []
    for _ in range(11):
        seconds, heard = shown.evaluate("Object.values(scene.playback.drawn)")
        off.append(abs(seconds - heard))
        shown.wait_for_timeout(30)
    assert max(off) < FRAME


def test_an_impact_sounds_when_the_scene_says_that_it_does(shown):
    tap(shown)
    begin(shown)
    onset = until_page(shown, "tapped[0]?.onset")
    # The first sample of an impact is not silent.
    assert abs(shown.evaluate(f"scene.sound.playedAt({onset})") - bounces(SECONDS)[0][0]) < 1e-3


def test_time_passes_evenly_and_follows_the_sound(modules):
    """The sound's time comes in pieces of 10 ms, a jump is taken at once, and on a machine that has
    no time for sound, whose pieces are of 40 ms, what is seen stays with it.
    """
    steps, jump, starved = modules.evaluate(
        """async () => {
          const { Clock } = await import("/scene/playback.js");
          const [clock, seen, off] = [new Clock(), [], []];
          for (let frame = 0; frame < 200; frame++) {
            const now = frame / 60;
            seen.push(clock.follow(Math.floor(now / 0.01) * 0.01, now) - now);
          }
          const jump = clock.follow(9, 200 / 60);
          for (let frame = 0; frame < 200; frame++) {
            const heard = Math.floor(frame / 60 / 0.04) * 0.04;
            off.push(Math.abs(clock.follow(heard, frame / 60) - heard));
          }
          return [seen, jump, off];
        }"""
    )
    late = np.array(steps[50:])
    assert late.min() > -0.01 and late.max() < 0.0
    assert np.ptp(late) < 0.003
    assert jump == 9.0
    assert max(starved) < FRAME


def test_nothing_is_heard_beyond_the_end(modules):
    """The last picture is the end's, however far beyond it the sound's time says that it is."""
    last, off, runs = modules.evaluate(
        """async () => {
          const { Playback } = await import("/scene/playback.js");
          const sound = { from: 0, heard: 0, allowed: async () => {}, play() {}, stop() {} };
          const playback = new Playback(sound, 1);
          await playback.play();
          const off = [];
          for (let piece = 0; playback.runs && piece < 100; piece++) {
            await new Promise(requestAnimationFrame);
            sound.heard = piece * 0.07;
            playback.frame();
            off.push(Math.abs(playback.drawn.seconds - playback.drawn.heard));
          }
          return [playback.at, off, playback.runs];
        }"""
    )
    assert last == 1.0 and not runs
    assert max(off) < FRAME


def test_numbers_are_written_as_people_read_them(modules):
    found = modules.evaluate(
        """async () => {
          const say = await import("/scene/numbers.js");
          return [
            [1.25, 0.034, 0.0004, 2e-8, 0.9999].map(say.impulse),
            [0.5, 0.05, 0.1, 1].map(say.length),
            [0.0003, 0.0123, 0.00005].map(say.milliseconds),
            [312.4, 2345].map(say.frequency),
          ];
        }"""
    )
    assert found == [
        ["1.3 N s", "34 mN s", "400 µN s", "0.02 µN s", "1.0 N s"],
        ["50 cm", "5 cm", "10 cm", "1 m"],
        ["0.30 ms", "12 ms", "0.05 ms"],
        ["312 Hz", "2.35 kHz"],
    ]


def test_is_sought_by_keys_and_timeline(shown):
    at, rows = "scene.playback.at", "document.querySelectorAll('#impacts tbody tr').length"
    shown.keyboard.press("ArrowRight")
    assert shown.evaluate(at) == pytest.approx(0.5)
    until_page(shown, f"{rows} === 1")
    box = shown.locator("#timeline input").bounding_box()
    shown.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] - 14)
    assert shown.evaluate(at) == pytest.approx(SECONDS / 2, abs=0.02)
    shown.keyboard.press("ArrowLeft")
    assert shown.evaluate(at) == pytest.approx(SECONDS / 2 - 0.5, abs=0.02)
    struck = [each for each in bounces(SECONDS) if each[0] <= shown.evaluate(at)]
    until_page(shown, f"{rows} === {len(struck)}")
    first = shown.locator("#impacts tbody tr").last.inner_text()
    assert first.split("\t") == ["0.25 s", "ball on ground", "485 mN s", "0.30 ms"]
    shown.keyboard.press("Home")
    assert shown.evaluate(at) == 0.0
    shown.evaluate("scene.playback.loop = true")
    shown.keyboard.press(" ")
    until_page(shown, "scene.playback.runs")
    assert not shown.is_visible("#begin")
    shown.keyboard.press(" ")
    assert not shown.evaluate("scene.playback.wanted")


def test_ends_or_plays_over_and_over(shown):
    shown.evaluate(f"scene.playback.seek({SECONDS - 0.2})")
    begin(shown)
    until_page(shown, "!scene.playback.wanted")
    assert shown.evaluate("scene.playback.at") == SECONDS
    shown.click("#loop")
    shown.evaluate(f"scene.playback.seek({SECONDS - 0.2})")
    shown.click("#play")
    until_page(shown, "scene.playback.at < 1")
    assert shown.evaluate("scene.playback.runs")
    shown.click("#play")
    assert shown.evaluate("scene.sound.playing") is None


def test_is_struck_while_it_plays_and_while_it_does_not(shown):
    struck = "scene.sound.bank.level().ringing"
    endlessly(shown)
    shown.mouse.click(*middle_of(shown, BLOCK))
    until_page(shown, f"{struck} === 4")
    assert "block: struck with" in shown.inner_text("#told")
    shown.keyboard.press(" ")
    shown.evaluate("scene.sound.bank.silence()")
    until_page(shown, f"{struck} === 0")
    shown.mouse.click(*middle_of(shown, CONE))
    assert shown.inner_text("#told") == "cone is silent: it has no modes here."
    shown.wait_for_timeout(100)
    assert shown.evaluate(struck) == 0
    shown.mouse.click(*middle_of(shown, BALL))
    until_page(shown, f"{struck} === 3")
    shown.evaluate("scene.sound.bank.silence()")
    shown.get_by_role("button", name="block").click()
    until_page(shown, f"{struck} === 4")
    assert "block: struck with" in shown.inner_text("#told")


def test_the_middle_is_struck_by_a_key(shown):
    endlessly(shown)
    shown.keyboard.press(" ")
    shown.evaluate(
        """() => {
          const { controls, actors } = scene.stage;
          controls.target.copy(actors[1].mesh.position);
          scene.stage.move({ nearer: 1.2 });
          scene.stage.canvas.focus();
        }"""
    )
    before = shown.evaluate("scene.stage.camera.position.toArray()")
    shown.keyboard.press("Enter")
    until_page(shown, "scene.sound.bank.level().ringing === 4")
    shown.keyboard.press("Shift+ArrowLeft")
    assert shown.evaluate("scene.stage.camera.position.toArray()") != before
    shown.keyboard.press("0")
    away = "Math.hypot(...[0.15, -0.95, 0.5].map((x, i) => at[i] - x))"
    until_page(shown, f"((at) => {away} < 1e-6)(scene.stage.camera.position.toArray())")


def test_nothing_is_beyond_full_scale(shown):
    tap(shown)
    begin(shown)
    until_page(shown, "scene.playback.at > 0.2")
    for _ in range(4):
        shown.evaluate("scene.sound.strike(scene.bodies[0], 0, 50)")
        shown.wait_for_timeout(60)
    until_page(shown, "tapped.at(-1)?.loudest > 0.5")
    shown.wait_for_timeout(200)
    assert shown.evaluate("tapped.at(-1).loudest") < 1.0 + 1e-6


def test_strikes_are_waves_or_dots_where_motion_is_unwelcome(browser, path):
    for motion, dotted in (("no-preference", False), ("reduce", True)):
        page = opened(browser, path, reduced_motion=motion)
        endlessly(page)
        page.keyboard.press(" ")
        page.evaluate(
            """() => {
              const { waves } = scene.stage.actors[1].surface;
              const start = waves.start.bind(waves);
              window.begun = 0;
              waves.start = (...how) => (begun++, start(...how));
            }"""
        )
        page.mouse.click(*middle_of(page, BLOCK))
        assert page.evaluate("scene.stage.actors[1].dot !== null") is dotted
        assert page.evaluate("begun") == (0 if dotted else 1)
        page.context.close()


def test_browsers_that_ask_for_a_click_are_given_one(browser, path):
    program = next(filter(None, map(shutil.which, PROGRAMS)))
    asking = [each for each in ARGUMENTS if "autoplay" not in each]
    other = browser.browser_type.launch(executable_path=program, args=asking)
    page = other.new_page()
    # What playwright evaluates passes for a click: the page tells by itself.
    page.add_init_script(
        """const look = setInterval(() => {
          if (!window.scene) return;
          clearInterval(look);
          console.log(scene.sound.bank.state, document.getElementById("begin").innerText);
        }, 50)"""
    )
    with page.expect_console_message(lambda said: said.type == "log") as said:
        page.goto(path.as_uri())
    assert said.value.text.startswith("suspended")
    assert "only after a click" in said.value.text
    page.mouse.click(300, 300)
    until_page(page, "scene.playback.at > 0.1")
    assert page.evaluate("scene.sound.bank.state") == "running"
    assert page.inner_text("#asked") == ""
    other.close()


def test_without_graphics_it_is_heard(browser, path):
    page = browser.new_page()
    page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page.goto(path.as_uri())
    page.wait_for_selector("#begin:not([hidden])")
    assert "heard alone" in page.inner_text("#message")
    begin(page)
    page.get_by_role("button", name="block").click()
    until_page(page, "scene.sound.bank.level().ringing === 4")
    until_page(page, "document.querySelectorAll('#impacts tbody tr').length > 0")
    page.close()


def test_names_are_no_markup(browser, tmp_path):
    path = tmp_path / "page.html"
    told = performance(tuple(f"{HOSTILE}{number}" for number in range(3)))
    write_scene_page(path, replace(told, title=HOSTILE))
    assert HOSTILE not in path.read_text(encoding="utf-8")
    page = opened(browser, path)
    page.evaluate("scene.playback.seek(1)")
    page.get_by_role("button", name=f"{HOSTILE}1").click()
    until_page(page, "document.querySelectorAll('#impacts tbody tr').length > 0")
    page.wait_for_timeout(100)
    assert page.evaluate("typeof window.broken") == "undefined"
    assert page.inner_text("h1") == HOSTILE
    assert f"{HOSTILE}2" in page.inner_text("#bodies")
    assert f"{HOSTILE}0 on ground" in page.inner_text("#impacts")
    assert page.faults == []
    page.context.close()


@pytest.mark.parametrize(("scheme", "width"), [("light", 390), ("dark", 1000)])
def test_axe_finds_nothing_serious(browser, path, scheme, width):
    page = opened(browser, path, viewport={"width": width, "height": 600}, color_scheme=scheme)
    for deed in ("", "scene.playback.seek(1)", "document.querySelector('summary').click()"):
        page.evaluate(deed)
        assert axe_finds(page) == []
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.context.close()


def test_the_sound_is_read_without_loss_but_for_dither(browser):
    sound = np.random.default_rng(3).uniform(-1.0, 1.0, (RATE // 10, 2))
    file = flac(sound, RATE)
    read, rate = soundfile.read(io.BytesIO(file))
    assert rate == RATE
    np.testing.assert_allclose(read, sound, rtol=0.0, atol=1.51 * 2.0**-23)
    page = browser.new_page()
    page.evaluate(
        """async ([text, rate]) => {
          const file = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
          const context = new OfflineAudioContext(2, 1, rate);
          window.decoded = await context.decodeAudioData(file);
        }""",
        [base64.b64encode(file).decode(), RATE],
    )
    for ear in range(2):
        found = samples(page, f"window.decoded.getChannelData({ear})")
        np.testing.assert_array_equal(found, read[:, ear].astype("<f4"))
    page.close()


def test_holds_what_it_says_to_a_stated_error():
    told = performance()
    header, arrays = unpack(content(told))
    assert header["seconds"] == pytest.approx(SECONDS)
    assert header["step_s"] == pytest.approx(1.0 / STEPS_PER_SECOND)
    motion = told.picture.motion
    np.testing.assert_array_equal(arrays["moved"], motion.positions.astype("f4"))
    np.testing.assert_array_equal(arrays["turned"], motion.rotations.astype("f4"))
    np.testing.assert_array_equal(arrays["impact_pairs"][:, 1], GROUND_ON_PAGE)
    struck = [each.impulse[2] for each in told.impacts]
    np.testing.assert_allclose(arrays["impact_impulses"], struck)
    for number, (surface, sung) in enumerate(zip(told.picture.objects, told.voices)):
        object_ = header["objects"][number]
        places = np.array(object_["origin_m"])
        places = places + arrays[f"places_{number}"].T * object_["step_m"]
        side = np.ptp(surface.vertices, axis=0).max()
        np.testing.assert_allclose(places, surface.vertices, atol=0.51 * side / STEPS)
        np.testing.assert_array_equal(arrays[f"triangles_{number}"], surface.faces)
        if sung is None:
            assert f"halves_{number}" not in arrays and "impulse_ns" not in object_
            continue
        low, high = arrays[f"halves_{number}"].view("u1").reshape(2, -1)
        halves = np.column_stack([low, high]).ravel().view("<f2").astype(float)
        gains = halves.reshape(len(sung.frequencies), -1).T * arrays[f"loudest_{number}"]
        np.testing.assert_allclose(gains, sung.gains, rtol=GAIN_ERROR)


def test_a_strike_by_hand_is_as_the_hardest_impact_as_far_as_that_is_well_heard():
    told = performance()
    voice = told.voices[BALL]
    assert voice is not None
    loudest = voice.gains.sum(axis=1).max()
    for impulse, wanted in [
        (0.3 / loudest, 0.3 / loudest),
        (1e-6 / loudest, QUIETEST_STRIKE / loudest),
        (1e6 / loudest, LOUDEST_STRIKE / loudest),
    ]:
        struck = [each._replace(impulse=np.array([0.0, 0.0, impulse])) for each in told.impacts]
        header, _ = unpack(content(replace(told, impacts=struck)))
        assert header["objects"][BALL]["impulse_ns"] == pytest.approx(wanted)
        assert header["objects"][BALL]["contact_s"] == pytest.approx(3e-4)
        assert header["objects"][BLOCK]["contact_s"] == 0.0


def test_is_the_same_twice(path, tmp_path):
    again = tmp_path / "again.html"
    write_scene_page(again, performance())
    assert again.read_bytes() == path.read_bytes()


def test_a_large_page_is_told(tmp_path, capsys, monkeypatch):
    write_scene_page(tmp_path / "small.html", performance())
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(page, "LARGE_BYTES", 1000)
    write_scene_page(tmp_path / "large.html", performance())
    said = capsys.readouterr().err
    assert "large.html" in said and "MB" in said and "7 modes" in said


def test_what_does_not_fit_is_told(tmp_path):
    told = performance()
    with pytest.raises(UserError, match=r"voices \(2,\), expected \(3,\)"):
        write_scene_page(tmp_path / "page.html", replace(told, voices=told.voices[:2]))
    with pytest.raises(UserError, match="gains of 'ball'"):
        write_scene_page(tmp_path / "page.html", replace(told, voices=[told.voices[1]] * 3))
    with pytest.raises(UserError, match="no number"):
        write_scene_page(tmp_path / "page.html", replace(told, sound=told.sound + np.nan))
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(UserError, match="nowhere"):
        write_scene_page(tmp_path / "nowhere" / "page.html", told)
