"""The studio while a search has all cores: strikes, news, stop, memory (test support).

    python -m tests.studio_load               one minute, then what was measured

A real studio is opened with an example whose material is sought meanwhile.
"""

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from tests.chromium import chromium
from tests.patience import HANG_SECONDS
from tests.strike_latency import IN_STUDIO, STRIKES, TAP_ADDRESS

EXAMPLE = "e2"
STRIKES_COUNTED, UPDATES_COUNTED = 500, 1000
NEWS_SECONDS = 20.0
COUNT = """() => {
  window.news = { bank: [], progress: [] };
  studio.connection.onBinary("bank", (header, arrays) => {
    window.news.bank.push(performance.now());
    window.last = { header, arrays };
  });
  studio.connection.onEvent("progress", () => window.news.progress.push(performance.now()));
}"""
STOP = """() => new Promise((resolve) => {
  const begin = performance.now();
  studio.state.onChange((now) => {
    if (now.search.phase === "idle") resolve(performance.now() - begin);
  });
  studio.connection.call("stop");
})"""
WEAR = """async ([strikes, updates]) => {
  const vertices = window.last.arrays.young.length;
  for (let k = 0; k < strikes; k++) {
    studio.bank.strike((7919 * k) % vertices);
    await new Promise((done) => setTimeout(done, 2));
  }
  for (let k = 0; k < updates; k++) {
    const { header, arrays } = window.last;
    const copies = Object.entries(arrays).map(([name, values]) => [name, values.slice()]);
    const fresh = { ...header, number: 1e6 + k };
    studio.connection.listeners.tell("binary bank", fresh, Object.fromEntries(copies));
    await new Promise((done) => setTimeout(done, 2));
  }
}"""


@contextmanager
def real_studio(folder: str | Path, *what: str) -> Iterator[str]:
    """Address of a studio that works in a folder, and begins with what it is given."""
    program = str(Path(sys.executable).with_name("carillon"))
    command = [program, "studio", *what, "--workspace", str(folder), "--no-browser"]
    served = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert served.stdout is not None
        yield served.stdout.readline().strip()
    finally:
        served.terminate()
        served.wait(HANG_SECONDS)


def until(page: Any, expression: str) -> None:
    """Wait until something is so in the page."""
    end = time.monotonic() + HANG_SECONDS
    while not page.evaluate(expression):
        assert time.monotonic() < end, expression
        page.wait_for_timeout(50)


def heap_megabytes(page: Any) -> float:
    """What the page's objects take once nobody needs the others."""
    session = page.context.new_cdp_session(page)
    session.send("HeapProfiler.collectGarbage")
    session.send("Performance.enable")
    metrics = {
        each["name"]: each["value"] for each in session.send("Performance.getMetrics")["metrics"]
    }
    return float(metrics["JSHeapUsedSize"]) / 1e6


def main() -> None:
    """Measure and print."""
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        with real_studio(folder) as address:
            # The page's own rules let nobody look at its sound.
            context = browser.new_context(bypass_csp=True, viewport={"width": 1280, "height": 800})
            page = context.new_page()
            page.add_init_script("localStorage.setItem('carillon-studio-tour', 'seen')")
            page.goto(address)
            page.wait_for_url(lambda url: "token" not in url)
            until(page, "window.studio?.state?.current")
            page.evaluate(COUNT)
            begin = time.monotonic()
            page.evaluate("(e) => studio.connection.call('open_project', { project: e })", EXAMPLE)
            until(page, "studio.state.current.wanted && studio.view.settled")
            print(f"solid and clip ready {time.monotonic() - begin:.1f} s after they were opened")
            page.evaluate(
                "studio.connection.call('change_settings',"
                " { settings: { optimiser: { seconds: null } } })"
            )
            page.evaluate("(async () => { window.news.bank = []; })()")
            begin = time.monotonic()
            page.evaluate("studio.connection.call('optimise')")
            until(page, "window.news.bank.length > 0")
            print(f"first news of a material after {time.monotonic() - begin:.1f} s")
            page.wait_for_timeout(1000 * NEWS_SECONDS)
            for name in ("progress", "bank"):
                times = np.array(page.evaluate(f"window.news.{name}"))
                gaps = np.diff(times) / 1000.0
                print(
                    f"{name}: {len(times)} in {np.ptp(times) / 1000:.1f} s, gaps of "
                    f"{np.median(gaps):.2f} s (median), {gaps.max():.2f} s (longest)"
                )
            page.evaluate(IN_STUDIO)
            closing = STRIKES.replace("await bank.close();", "")
            found = page.evaluate(closing, {"count": 100, "tap": TAP_ADDRESS})
            for name in ("sound", "page"):
                times = np.array(found[name])
                print(f"strike to {name}: {np.median(times):.2f} ms (median), {times.max():.2f} ms")
            print(f"stopped after {page.evaluate(STOP):.0f} ms")
            page.wait_for_timeout(5000)
            before = heap_megabytes(page)
            page.evaluate(WEAR, [STRIKES_COUNTED, UPDATES_COUNTED])
            print(
                f"page's objects: {before:.1f} MB, after {STRIKES_COUNTED} strikes and "
                f"{UPDATES_COUNTED:,} updates {heap_megabytes(page):.1f} MB"
            )
            context.close()


if __name__ == "__main__":
    main()
