"""How soon a strike sounds in the studio's page, and how many modes it can sound (test support).

    python -m tests.strike_latency            100 strikes, and the load of 4,000 modes

Times are from a pointerdown to the first sample that is not zero, on the clock of the sound, and
until the page knows of it, on its own clock.  What comes after, in buffers of the system, is what
the browser says of it.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from tests.chromium import chromium, served

TAP = """
class Tap extends AudioWorkletProcessor {
  constructor() {
    super();
    this.silent = false;
  }
  process(inputs) {
    const samples = inputs[0][0] ?? [];
    const at = samples.findIndex((sample) => sample !== 0);
    if (this.silent && at >= 0) this.port.postMessage((currentFrame + at) / sampleRate);
    this.silent = at < 0;
    return true;
  }
}
registerProcessor("tap", Tap);
"""
STRIKES = """async ({ count, modes }) => {
  const { makeBank } = await import("/page/sound/bank.js");
  const bank = makeBank();
  const { context } = bank;
  const hertz = Float64Array.from({ length: modes }, (_, k) => 200 * 1.1 ** k);
  bank.take({ event: "bank" }, {
    hertz, dampings: new Float64Array(modes).fill(30),
    gains: new Float32Array(modes).fill(0.5 / modes),
  });
  await bank.ready;
  await context.resume();
  await context.audioWorklet.addModule("/more/tap.js");
  const tap = new AudioWorkletNode(context, "tap", { numberOfOutputs: 1 });
  bank.output.connect(tap).connect(context.destination);
  const wait = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));
  document.body.addEventListener("pointerdown", () => bank.strike(0, 1, { contactSeconds: 0.001 }));
  const sound = [], page = [];
  await wait(500);
  for (let number = 0; number < count; number++) {
    bank.silence();
    await wait(60 + 40 * Math.random());
    const heard = new Promise((resolve, reject) => {
      tap.port.onmessage = (event) => resolve([event.data, performance.now()]);
      setTimeout(() => reject(new Error("a strike was not heard within 5 s")), 5000);
    });
    const began = [context.currentTime, performance.now()];
    document.body.dispatchEvent(new PointerEvent("pointerdown", { bubbles: true }));
    const ended = await heard;
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
    """Milliseconds of `count` strikes, `sound` and `page`, and what the browser says of latency."""
    return dict(page.evaluate(STRIKES, {"count": count, "modes": modes}))


def load(page: Any, modes: int, seconds: float = 10.0, rate: int = 48_000) -> float:
    """Time that so many modes that ring take, over the time that they sound."""
    return float(page.evaluate(LOAD, {"modes": modes, "seconds": seconds, "rate": rate}))


def write_tap(folder: Path) -> None:
    """The processor that sees the first sample."""
    (folder / "tap.js").write_text(TAP)


def main() -> None:
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--count", type=int, default=100, help="strikes (default 100)")
    parser.add_argument("--modes", type=int, default=30, help="modes of the solid (default 30)")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name, chromium() as browser, served(Path(name)) as at:
        write_tap(Path(name))
        page = browser.new_page()
        page.goto(f"{at}/")
        found = measure(page, arguments.count, arguments.modes)
        print(f"{arguments.count} strikes of {arguments.modes} modes at {found['rate']:g} Hz")
        for kind, what in (("sound", "to the first sample"), ("page", "until the page knows")):
            median, most = np.median(found[kind]), np.max(found[kind])
            print(f"  {what:22} median {median:6.2f} ms, worst {most:6.2f} ms")
        base, output = 1000 * found["baseSeconds"], 1000 * found["outputSeconds"]
        print(f"  buffers, by the browser: base {base:.2f} ms, output {output:.2f} ms")
        for modes in (256, 1000, 4000):
            print(f"{modes:5} modes that ring: {100 * load(page, modes):5.1f} % of one core")


if __name__ == "__main__":
    main()
