"""The page's sound, in a real browser: it is that of `sound render`, sample by sample."""

import base64
import io
import struct

import numpy as np
import pytest
import soundfile

from sound.clips.wav import read_wav
from sound.rendering.listening import Listening
from sound.rendering.render import Hit, render
from sound.rendering.solid import SoundingSolid
from sound.synthesis.sinusoids import Bank, ring
from tests.chromium import chromium, served
from tests.patience import PATIENCE_SECONDS
from tests.small_design import small_design
from tests.strike_latency import measure

RATE = 44_100
TONE_HERTZ = 1234.5
"""What the browser's made-up microphone hears, at half of full scale."""

RENDER = """async (sound) => {
  const { renderOffline } = await import("/page/sound/offline.js");
  return window.packed(await renderOffline(sound));
}"""
PACKED = """() => {
  window.packed = (samples) => {
    const bytes = new Uint8Array(samples.buffer ?? samples);
    let text = "";
    for (let i = 0; i < bytes.length; i += 8192) {
      text += String.fromCharCode(...bytes.subarray(i, i + 8192));
    }
    return btoa(text);
  };
}"""
"""Arrays come back as text: a number at a time takes long."""
UNTIL = f"""() => {{
  window.until = async (met) => {{
    const end = performance.now() + {1000 * PATIENCE_SECONDS};
    while (!met() && performance.now() < end) await new Promise((done) => setTimeout(done, 20));
  }};
}}"""
"""Waits until something is met; what is asserted then tells if it never was."""
ECHO = """() => {
  const processor = `registerProcessor("echo", class extends AudioWorkletProcessor {
    constructor() {
      super();
      this.port.onmessage = (event) => this.port.postMessage(event.data);
    }
    process() { return true; }
  })`;
  window.makeEcho = async (context) => {
    await context.audioWorklet.addModule(`data:text/javascript,${encodeURIComponent(processor)}`);
    const node = new AudioWorkletNode(context, "echo");
    return () => new Promise((resolve) => {
      node.port.onmessage = resolve;
      node.port.postMessage("");
    });
  };
}"""
"""What the thread of sound was told before has come to it once this is answered."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Files that the page can have beside the studio's."""
    return tmp_path_factory.mktemp("more")


@pytest.fixture(scope="module")
def page(folder):
    """An empty page beside the modules of the studio."""
    tone = 0.5 * np.sin(2 * np.pi * TONE_HERTZ * np.arange(3 * RATE) / RATE)
    soundfile.write(folder / "tone.wav", tone, RATE, subtype="PCM_16")
    heard = f"--use-file-for-fake-audio-capture={folder / 'tone.wav'}"
    with chromium(heard) as browser, served(folder) as address:
        page = browser.new_page()
        page.goto(f"{address}/")
        for helper in (PACKED, UNTIL, ECHO):
            page.evaluate(helper)
        yield page


def samples(packed: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(packed), "<f4").astype(float)


def rendered(page, hertz, dampings, messages, seconds=0.5, rate=RATE) -> np.ndarray:
    """Samples of the page's processor, told `messages`."""
    sound = {"hertz": list(map(float, hertz)), "dampings": list(map(float, dampings))}
    more = {"messages": messages, "seconds": seconds, "rate": rate}
    return samples(page.evaluate(RENDER, {**sound, **more}))


def struck(gains, at=0.0, contact=0.0) -> dict:
    gains = [float(gain) for gain in gains]
    return {"do": "strike", "gains": gains, "at_seconds": at, "contact_seconds": contact}


def decibels(found: np.ndarray, truth: np.ndarray) -> float:
    """Level of the difference below the truth's."""
    apart = max(float(np.linalg.norm(found - truth)), 1e-30)
    return 20 * np.log10(apart / float(np.linalg.norm(truth)))


def measured(sound: np.ndarray, near: float, rate: int) -> float:
    """Frequency of the partial near one, half a hertz off or less: by phases of windowed sums."""
    half = len(sound) // 2
    window = np.hanning(half)
    t = np.arange(half) / rate
    for _ in range(4):
        turns = np.exp(-2j * np.pi * near * t) * window
        first, second = (
            np.vdot(turns.conj(), part) for part in (sound[:half], sound[half : 2 * half])
        )
        step = np.angle(second / first * np.exp(-2j * np.pi * near * half / rate))
        near += step * rate / (2 * np.pi * half)
    return near


@pytest.mark.parametrize("contact", [0.0, 0.001, 0.0035])
def test_strikes_sound_as_rendered(page, contact):
    design = small_design()
    solid = SoundingSolid.of_design(design)
    listening = Listening.of_design(design, solid)
    times = (0.0, 0.1234567)
    hits = [
        Hit(seconds, strike.position, strength * strike.inward)
        for seconds, strength, strike in zip(times, (1.0, 0.4), design.strikes, strict=True)
    ]
    truth = render(solid, hits, 0.6, RATE, contact, listening, residual=False)
    gains = [
        solid.amplitudes(hit.position[None], hit.impulse[None])[0] * listening.gain(hit.position)
        for hit in hits
    ]
    messages = [struck(row, at, contact) for row, at in zip(gains, times, strict=True)]
    found = rendered(page, solid.frequencies, solid.dampings, messages, 0.6)
    assert np.abs(truth).max() < 1.0
    assert decibels(found, truth) < -120.0


def test_many_modes_and_strikes_at_once_sound_as_rendered(page):
    random = np.random.default_rng(3)
    hertz, dampings = random.uniform(30.0, 20_000.0, 301), random.uniform(1.0, 900.0, 301)
    times = [0.0, 0.0003, 0.0009, 0.1, 0.1001]
    gains = random.uniform(0.0, 1e-3, (5, 301))
    gains[:, ::7] = 0.0
    truth = ring(Bank(hertz, dampings, RATE), zip(times, gains), RATE // 2)
    found = rendered(page, hertz, dampings, [struck(g, t) for g, t in zip(gains, times)])
    assert decibels(found, truth) < -120.0


@pytest.mark.parametrize("rate", [44_100, 48_000, 96_000])
def test_frequencies_are_right_at_any_rate(page, rate):
    hertz = np.array([55.3, 441.7, 3001.9, 12_345.6])
    for frequency in hertz:
        found = rendered(page, [frequency], [1.0], [struck([0.5])], 1.0, rate)
        assert abs(1200 * np.log2(measured(found, frequency + 0.2, rate) / frequency)) < 0.1


def test_what_the_rate_cannot_hold_is_muted(page):
    hertz, gains = [1000.0, 11_025.0, 15_000.0], [0.1, 0.1, 0.1]
    found = rendered(page, hertz, [5.0] * 3, [struck(gains)], 0.3, 22_050)
    alone = rendered(page, hertz[:1], [5.0], [struck(gains[:1])], 0.3, 22_050)
    np.testing.assert_array_equal(found, alone)


def test_modes_that_are_no_numbers_or_grow_stay_silent(page):
    hertz, dampings = [500.0, float("nan"), 700.0, 900.0], [5.0, 5.0, float("nan"), -1.0]
    found = rendered(page, hertz, dampings, [struck([0.1] * 4)], 0.2)
    alone = rendered(page, hertz[:1], dampings[:1], [struck([0.1])], 0.2)
    np.testing.assert_allclose(found, alone, atol=1e-7)


def test_limiter_touches_nothing_below_full_scale_and_lets_nothing_beyond(page):
    hertz, dampings = [100.0, 1234.5], [8.0, 9.0]

    def sound(strength: float) -> np.ndarray:
        return rendered(page, hertz, dampings, [struck([0.6 * strength, 0.3 * strength])], 1.2)

    truth = ring(
        Bank(np.array(hertz), np.array(dampings), RATE),
        [(0.0, np.array([0.6, 0.3]))],
        round(1.2 * RATE),
    )
    assert 0.5 < np.abs(truth).max() < 1.0
    quiet, loud = sound(1.0), sound(20.0)
    # To the last bit: a strike of half the strength has half of every sample.
    np.testing.assert_array_equal(sound(0.5), quiet / 2.0)
    assert decibels(quiet, truth) < -120.0
    assert np.abs(loud).max() <= 1.0
    assert np.abs(loud).max() > 0.9
    # It lets go: what is below full scale is itself again.
    end = slice(-RATE // 10, None)
    assert np.abs(20.0 * truth[end]).max() < 0.9
    np.testing.assert_array_equal(loud[end], sound(5.0)[end] * 4.0)


def test_a_new_material_lets_the_old_one_ring_out(page):
    at = 0.1
    found = page.evaluate(
        """async ({ at, rate }) => {
          const { makeNode } = await import("/page/sound/bank.js");
          const context = new OfflineAudioContext(1, rate / 2, rate);
          await context.audioWorklet.addModule("/page/sound/bank-processor.js");
          const node = makeNode(context, [
            { do: "bank", hertz: [440], dampings: [20] },
            { do: "strike", gains: [0.3], at_seconds: 0 },
          ]);
          node.connect(context.destination);
          const echo = await window.makeEcho(context);
          context.suspend(at).then(async () => {
            node.port.postMessage({ do: "bank", hertz: [1000, 1500], dampings: [30, 40] });
            node.port.postMessage({ do: "strike", gains: [0.2, 0.1] });
            await echo();
            context.resume();
          });
          return window.packed((await context.startRendering()).getChannelData(0));
        }""",
        {"at": at, "rate": RATE},
    )
    first = np.ceil(at * RATE / 128) * 128 / RATE
    old = ring(Bank(np.array([440.0]), np.array([20.0]), RATE), [(0.0, np.array([0.3]))], RATE // 2)
    bank = Bank(np.array([1000.0, 1500.0]), np.array([30.0, 40.0]), RATE)
    new = ring(bank, [(first, np.array([0.2, 0.1]))], RATE // 2)
    assert decibels(samples(found), old + new) < -120.0


def test_solo_mute_and_volume(page):
    hertz, dampings, gains = [300.0, 700.0, 1100.0], [5.0, 6.0, 7.0], [0.2, 0.1, 0.15]

    def sound(*messages: dict) -> np.ndarray:
        return rendered(page, hertz, dampings, [*messages, struck(gains)], 0.2)

    def alone(*numbers: int) -> np.ndarray:
        kept = [gain if number in numbers else 0.0 for number, gain in enumerate(gains)]
        return rendered(page, hertz, dampings, [struck(kept)], 0.2)

    # Weights reach their values within a block.
    after = slice(128, None)
    solo = sound({"do": "heard", "solo": [1], "muted": []})
    assert decibels(solo[after], alone(1)[after]) < -120.0
    muted = sound({"do": "heard", "solo": None, "muted": [1]})
    assert decibels(muted[after], alone(0, 2)[after]) < -120.0
    quiet = sound({"do": "volume", "volume": 0.25})
    assert decibels(quiet[after], alone(0, 1, 2)[after] / 4.0) < -120.0


def test_silence_is_exact_once_all_has_died_away(page):
    found = rendered(page, [500.0], [100.0], [struck([0.5])], 0.5)
    assert np.abs(found[: RATE // 10]).max() > 0.1
    assert np.all(found[-RATE // 10 :] == 0.0)


def test_bad_gains_do_not_end_the_sound(page):
    strikes = [{**struck([0.1, 0.1]), "gains": ["", 0.1]}, struck([0.1, 0.1], 0.05)]
    strikes[0]["gains"] = [None, 0.1]
    found = rendered(page, [500.0, 900.0], [10.0, 10.0], strikes, 0.2)
    assert np.isfinite(found).all()
    assert np.abs(found[RATE // 10 :]).max() > 0.01


def test_recordings_are_wav_of_raw_samples(page):
    written = page.evaluate(
        """async () => {
          const { wavBytes } = await import("/page/sound/wav.js");
          return window.packed(wavBytes([[0, 0.5, -1.5], [1e-6, 0.25, 0]], 48000));
        }"""
    )
    written = base64.b64decode(written)
    found, rate = soundfile.read(io.BytesIO(written), dtype="float32")
    assert rate == 48_000
    expected = np.array([[0, 0.5, -1.5], [1e-6, 0.25, 0]], np.float32)
    np.testing.assert_array_equal(found, expected.T)
    assert struct.unpack("<I", written[4:8])[0] == len(written) - 8


def test_microphone_is_recorded(page, tmp_path):
    recorded = page.evaluate(
        """async () => {
          const { makeRecorder } = await import("/page/sound/recorder.js");
          const recorder = makeRecorder();
          await recorder.start();
          await window.until(() => recorder.seconds > 1.5);
          const level = recorder.level();
          const blob = await recorder.stop();
          return { level, bytes: window.packed(await blob.arrayBuffer()) };
        }"""
    )
    path = tmp_path / "recorded.wav"
    path.write_bytes(base64.b64decode(recorded["bytes"]))
    clip, rate = read_wav(path)
    assert 0.4 < recorded["level"] < 0.6
    assert 0.5 * rate < len(clip) < 10.0 * rate
    middle = clip[len(clip) // 4 : -len(clip) // 4]
    assert abs(measured(middle, TONE_HERTZ, rate) - TONE_HERTZ) < 0.5
    assert 0.45 < np.abs(middle).max() < 0.55


def test_live_bank_strikes_and_tells_its_level(page):
    told = page.evaluate(
        """async () => {
          const { makeBank } = await import("/page/sound/bank.js");
          const bank = makeBank();
          const arrays = {
            hertz: Float64Array.of(440, 900), dampings: Float64Array.of(3, 4),
            gains: Float32Array.of(0.1, 0.2, 0.3, 0.4), young: Float32Array.of(1, 1),
            struck: new Float64Array(0),
          };
          const before = bank.strike(0, 1);
          bank.take({ event: "bank", targets: [] }, arrays);
          const heard = [];
          bank.onStrike((struck) => heard.push(struck));
          const struck = [[1, 0.5], [2, 1], [-1, 1], [0.5, 1]].map((at) => bank.strike(...at));
          await bank.ready;
          let level;
          await window.until(() => (level = bank.level()).ringing > 0);
          const answer = { before, struck, heard, level, state: bank.state, latency: bank.latency };
          await bank.close();
          return answer;
        }"""
    )
    assert told["before"] is False
    assert told["struck"] == [True, False, False, False]
    assert told["heard"] == [{"vertex": 1, "strength": 0.5, "atSeconds": None}]
    assert told["state"] == "running"
    assert told["level"]["ringing"] == 2
    assert 0.0 < told["level"]["peak"] < 0.36
    assert set(told["latency"]) == {"baseSeconds", "outputSeconds"}


def test_materials_do_not_pile_up_while_nothing_sounds(page):
    told = page.evaluate(
        """async () => {
          const { makeBank } = await import("/page/sound/bank.js");
          const bank = makeBank();
          await bank.ready;
          await bank.context.suspend();
          const sent = [];
          const { port } = bank.output;
          const post = port.postMessage.bind(port);
          port.postMessage = (message) => {
            sent.push(message.hertz ? [message.do, message.hertz[0]] : message.do);
            post(message);
          };
          const take = (hertz) => bank.take({ event: "bank" }, {
            hertz: Float64Array.of(hertz), dampings: Float64Array.of(3), gains: Float32Array.of(1),
          });
          for (let k = 1; k <= 50; k++) take(k);
          const before = [...sent];
          bank.strike(0);
          await bank.context.resume();
          take(60);
          await bank.close();
          return { before, sent };
        }"""
    )
    assert told == {"before": [], "sent": [["bank", 50], "strike", ["bank", 60]]}


def test_strikes_are_heard_soon(page):
    found = measure(page, count=10)
    assert np.median(found["sound"]) < 20.0
    assert np.median(found["page"]) < 100.0


def test_weights_of_noise_are_those_of_listening(page):
    points = np.array([[0.0, 0.0, 0.1], [0.2, 0.1, 0.0], [-0.1, 0.3, 0.2]])
    listening = Listening(points, np.ones(3), (), (), np.ones(3))
    for position in ([0.01, 0.02, 0.03], [0.2, 0.1, 0.0], [0.3, 0.3, 0.3]):
        found = page.evaluate(
            """async ([points, position]) => {
              const { weightsAt } = await import("/page/sound/noise.js");
              return weightsAt(points, Float32Array.from(position));
            }""",
            [points.tolist(), position],
        )
        np.testing.assert_allclose(found, listening.weights(np.array(position)), rtol=1e-5)


def test_noise_goes_along_with_strikes_by_their_distance(page, folder):
    noises = 0.1 * np.random.default_rng(5).normal(size=(2, RATE // 10))
    points = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]])
    vertices = np.array([[0.1, 0.0, 0.0], [0.0, 0.0, 0.0]])
    for number, noise in enumerate(noises):
        place = folder / "clip" / f"c{number}" / "noise"
        place.parent.mkdir(parents=True)
        soundfile.write(place, noise, RATE, subtype="FLOAT", format="WAV")
    found = page.evaluate(
        """async ({ points, vertices, rate }) => {
          const { makeNoise } = await import("/page/sound/noise.js");
          const context = new OfflineAudioContext(1, rate / 2, rate);
          const input = new GainNode(context);
          input.connect(context.destination);
          let strike;
          const bank = { context, input, onStrike: (listener) => { strike = listener; } };
          const clips = points.map((_, n) => ({ clip: `c${n}`, phase: "ready", modes: [] }));
          const targets = points.map((at, n) => ({ position_m: at, clip: `c${n}`, without: [] }));
          const current = { clips, targets, solid: { surface: 7 } };
          const state = { current, onChange: (listener) => listener(current) };
          const positions = Float32Array.from(vertices.flat());
          const connection = { binary: async () => ({ arrays: { positions } }) };
          const noise = makeNoise({ bank, state, connection });
          strike({ vertex: 0, strength: 1, atSeconds: 0 });
          noise.on = true;
          await noise.loaded();
          strike({ vertex: 0, strength: 0.5, atSeconds: 0 });
          strike({ vertex: 1, strength: 1, atSeconds: 0.25 });
          return window.packed((await context.startRendering()).getChannelData(0));
        }""",
        {"points": points.tolist(), "vertices": vertices.tolist(), "rate": RATE},
    )
    expected = np.zeros(RATE // 2)
    expected[: noises.shape[1]] = 0.5 * (0.8 * noises[0] + 0.2 * noises[1])
    begin = RATE // 4
    expected[begin : begin + noises.shape[1]] += noises[0]
    assert decibels(samples(found), expected) < -100.0


def test_old_materials_fade_when_too_many_modes_ring(page):
    modes, times = 3000, 4
    found = page.evaluate(
        """async ({ modes, times, rate }) => {
          const { makeNode } = await import("/page/sound/bank.js");
          const context = new OfflineAudioContext(1, rate, rate);
          await context.audioWorklet.addModule("/page/sound/bank-processor.js");
          const hertz = Float64Array.from({ length: modes }, (_, k) => 50 + 3 * k);
          const dampings = new Float64Array(modes).fill(0.1);
          const gains = new Float64Array(modes).fill(1e-4);
          const messages = [];
          for (let number = 0; number < times; number++) {
            messages.push({ do: "bank", hertz, dampings }, { do: "strike", gains, at_seconds: 0 });
          }
          const node = makeNode(context, messages);
          const counts = [];
          node.port.onmessage = (event) => counts.push(event.data.ringing);
          node.connect(context.destination);
          const echo = await window.makeEcho(context);
          await context.startRendering();
          await echo();
          return counts;
        }""",
        {"modes": modes, "times": times, "rate": RATE},
    )
    assert max(found) > 2 * modes
    assert found[-1] <= modes + 4096


def test_clips_play_one_at_a_time_and_in_turn(page):
    told = page.evaluate(
        """async () => {
          const { makeBank } = await import("/page/sound/bank.js");
          const { makePlayer } = await import("/page/sound/player.js");
          const { wavBlob } = await import("/page/sound/wav.js");
          const bank = makeBank();
          const player = makePlayer({ bank });
          await bank.ready;
          const names = [];
          player.onChange((name) => names.push(name));
          const sound = (seconds) => wavBlob([new Float32Array(seconds * 48000).fill(0.1)], 48000);
          const first = player.play(sound(5), { name: "first" });
          await new Promise((resolve) => setTimeout(resolve, 200));
          const during = player.playing;
          let struck = 0;
          const pieces = [sound(0.1), () => { struck += 1; return 0.1; }];
          const second = player.playInTurn(pieces, { name: "second", gapSeconds: 0.05 });
          const ends = [await first, await second];
          const wrong = await player.play("/nothing.wav").catch((error) => error.message);
          const bad = await player.play("/page/sound/wav.js").catch((error) => error.message);
          const answer = { during, ends, names, struck, after: player.playing, wrong, bad };
          await bank.close();
          return answer;
        }"""
    )
    assert told["during"] is True and told["after"] is False
    assert told["ends"] == [False, True]
    assert told["names"][:3] == ["first", "second", None]
    assert told["struck"] == 1
    assert "404" in told["wrong"] and "cannot play" in told["bad"]
