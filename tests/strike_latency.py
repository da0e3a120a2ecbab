"""How soon a strike sounds in the studio's page, and how many modes it can sound (test support).

    python -m tests.strike_latency            100 strikes, and the load of 4,000 modes

Times are from a pointerdown to the first sample that is not zero, on the clock of the sound, and
until the page knows of it, on its own clock: once with nothing else in the page, once in the studio
with a made-up solid, where the pointerdown is on its view.  What comes after, in buffers of the
system, is what the browser says of it.
"""

import argparse
import tempfile
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from tests import studio_server
from tests.chromium import chromium, served

TAP = """
class Tap extends AudioWorkletProcessor {
  constructor() {
    super();
    this.silent = false;
    this.onset = null;
    this.loudest = 0;
  }
  process([ears]) {
    const at = (ears[0] ?? []).findIndex((sample) => sample !== 0);
    const begins = this.silent && at >= 0;
    const before = this.loudest;
    for (const ear of ears) this.loudest = Math.max(this.loudest, ...ear.map(Math.abs));
    if (begins) this.onset = (currentFrame + at) / sampleRate;
    if (begins || this.loudest > before) {
      this.port.postMessage({ onset: this.onset, loudest: this.loudest });
    }
    this.silent = at < 0;
    return true;
  }
}
registerProcessor("tap", Tap);
"""
TAP_ADDRESS = f"data:text/javascript,{quote(TAP)}"
"""Of a processor that tells when sound begins after silence, by the time of the context, and how
loud it has been: in the sound's own thread, so that it does not matter how seldom anybody looks.
"""
ALONE = """async (modes) => {
  const { makeBank } = await import("/page/sound/bank.js");
  const bank = makeBank();
  const hertz = Float64Array.from({ length: modes }, (_, k) => 200 * 1.1 ** k);
  bank.take({ event: "bank" }, {
    hertz, dampings: new Float64Array(modes).fill(30),
    gains: new Float32Array(modes).fill(0.5 / modes),
  });
  document.body.addEventListener("pointerdown", () => bank.strike(0));
  window.measured = { bank, element: document.body, place: () => [0, 0] };
}"""
IN_STUDIO = """async () => {
  const { bank, view } = window.studio;
  const wait = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));
  const element = document.querySelector("#view canvas");
  // The view may still change its size, so the solid is looked for before every strike.
  const place = () => {
    const box = element.getBoundingClientRect();
    for (let i = 1; i < 20; i++) {
      for (let j = 1; j < 20; j++) {
        const at = [box.left + (i * box.width) / 20, box.top + (j * box.height) / 20];
        if (view.pick(...at) !== null) return at;
      }
    }
    return null;
  };
  for (let tries = 0; tries < 200 && !(bank.current && place()); tries++) await wait(50);
  if (!place()) throw new Error("there is no solid to be struck");
  window.measured = { bank, element, place };
}"""
STRIKES = """async ({ count, tap: address }) => {
  const { bank, element, place } = window.measured;
  const { context } = bank;
  await bank.ready;
  await context.resume();
  await context.audioWorklet.addModule(address);
  const tap = new AudioWorkletNode(context, "tap", { numberOfOutputs: 1 });
  bank.output.connect(tap).connect(context.destination);
  const wait = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));
  const sound = [], page = [];
  bank.contactSeconds = 0.001;
  await wait(500);
  for (let number = 0; number < count; number++) {
    bank.silence();
    await wait(60 + 40 * Math.random());
    const heard = new Promise((resolve, reject) => {
      tap.port.onmessage = (event) => resolve([event.data.onset, performance.now()]);
      setTimeout(() => reject(new Error("a strike was not heard within 30 s")), 30000);
    });
    const [clientX, clientY] = place();
    const how = { bubbles: true, isPrimary: true, button: 0, clientX, clientY };
    const began = [context.currentTime, performance.now()];
    element.dispatchEvent(new PointerEvent("pointerdown", { ...how, buttons: 1 }));
    const ended = await heard;
    element.dispatchEvent(new PointerEvent("pointerup", how));
    sound.push(1000 * (ended[0] - began[0]));
    page.push(ended[1] - began[1]);
  }
  const { baseSeconds, outputSeconds } = bank.latency;
  const answer = { sound, page, baseSeconds, outputSeconds, rate: context.sampleRate };
  await bank.close();
  return answer;
}"""
LOAD = """async ({ modes, seconds, rate }) => {
  const { renderOffline } = await import("/page/sound/offline.js");
  const hertz = Float64Array.from({ length: modes }, (_, k) => 50 + (19000 * k) / modes);
  const dampings = new Float64Array(modes).fill(0.1);
  const gains = new Float64Array(modes).fill(0.1 / modes);
  const strike = { do: "strike", gains, at_seconds: 0, contact_seconds: 0.001 };
  const begin = performance.now();
  await renderOffline({ hertz, dampings, messages: [strike], seconds, rate });
  return (performance.now() - begin) / 1000 / seconds;
}"""


def measure(page: Any, count: int = 100, modes: int = 30) -> dict[str, Any]:
    """Milliseconds of `count` strikes, `sound` and `page`, and what the browser says of latency.

    The page is one of `tests.chromium.served`.
    """
    page.evaluate(ALONE, modes)
    return dict(page.evaluate(STRIKES, {"count": count, "tap": TAP_ADDRESS}))


def measure_in_studio(browser: Any, count: int = 100) -> dict[str, Any]:
    """The same in the studio's whole page, with a made-up bell."""
    with studio_server.served() as studio:
        # The page's own rules let nobody look at its sound.
        context = browser.new_context(bypass_csp=True, viewport={"width": 1280, "height": 800})
        page = context.new_page()
        page.goto(f"{studio.origin}/?token={studio.keys.token}")
        page.wait_for_selector("#view canvas")
        page.evaluate(IN_STUDIO)
        found = dict(page.evaluate(STRIKES, {"count": count, "tap": TAP_ADDRESS}))
        context.close()
        return found


def load(page: Any, modes: int, seconds: float = 10.0, rate: int = 48_000) -> float:
    """Time that so many modes that ring take, over the time that they sound."""
    return float(page.evaluate(LOAD, {"modes": modes, "seconds": seconds, "rate": rate}))


def main() -> None:
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--count", type=int, default=100, help="strikes (default 100)")
    parser.add_argument("--modes", type=int, default=30, help="modes of the solid (default 30)")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name, chromium() as browser, served(Path(name)) as at:
        page = browser.new_page()
        page.goto(f"{at}/")
        alone = measure(page, arguments.count, arguments.modes)
        print(
            f"{arguments.count} strikes of {arguments.modes} modes at {alone['rate']:g} Hz, alone"
        )
        _tell(alone)
        print(f"{arguments.count} strikes in the studio")
        _tell(measure_in_studio(browser, arguments.count))
        for modes in (256, 1000, 4000):
            print(f"{modes:5} modes that ring: {100 * load(page, modes):5.1f} % of one core")


def _tell(found: dict[str, Any]) -> None:
    for kind, what in (("sound", "to the first sample"), ("page", "until the page knows")):
        median, most = np.median(found[kind]), np.max(found[kind])
        print(f"  {what:22} median {median:6.2f} ms, worst {most:6.2f} ms")
    base, output = 1000 * found["baseSeconds"], 1000 * found["outputSeconds"]
    print(f"  buffers, by the browser: base {base:.2f} ms, output {output:.2f} ms")


if __name__ == "__main__":
    main()
