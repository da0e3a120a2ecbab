/** Recording a clip: a level, the time that is left, and buttons to keep or to discard it. */

import { attempt, giveClip } from "./chosen.js";
import { button, make, setText } from "./dom.js";
import { decibels, fixed } from "./numbers.js";

const FAINTEST_DECIBELS = -60;
const TICK_MS = 50;

/**
 * Makes the controls of a recording.
 *
 * @param {import("../main.js").Parts} parts
 * @returns {{ element: HTMLElement, start: (target: string) => Promise<void> }}
 */
export function makeRecording(parts) {
  let target = "";
  /** @type {number | null} */
  let timer = null;
  let taken = 0;

  const level = make("meter", { min: FAINTEST_DECIBELS, max: 0, high: -1, "aria-label": "Level [dB]" });
  const left = make("span", { class: "recording-left" });
  const said = make("p", { class: "hidden", role: "status" });
  const keep = button("Stop and keep", () => void finish(() => parts.recorder.stop()), { class: "main" });
  const discard = button("Discard", () => void finish(null));
  const element = make(
    "div",
    { class: "recording", role: "group", "aria-label": "Recording", hidden: true },
    make("span", { class: "recording-mark", "aria-hidden": "true" }, "\u25cf"),
    make("span", {}, "Recording"),
    level,
    left,
    make("div", { class: "row" }, keep, discard),
  );
  const frame = make("div", {}, element, said);

  /** @param {string} name of the target that gets the clip */
  async function start(name) {
    if (timer !== null) return;
    if (!(await attempt(parts, () => parts.recorder.start()))) return;
    target = name;
    element.hidden = false;
    setText(said, `Recording, ${parts.recorder.longestSeconds} seconds at most.`);
    keep.focus();
    timer = window.setInterval(tick, TICK_MS);
    tick();
  }

  function tick() {
    const seconds = parts.recorder.longestSeconds - parts.recorder.seconds;
    const peak = parts.recorder.level();
    level.value = peak > 0 ? Math.max(FAINTEST_DECIBELS, decibels(peak, 1)) : FAINTEST_DECIBELS;
    setText(left, `${fixed(Math.max(0, seconds), 1)} s left`);
  }

  /**
   * @param {(() => Promise<Blob>) | null} take gives what was recorded; `null` if it is not wanted
   */
  async function finish(take) {
    if (timer === null) return;
    window.clearInterval(timer);
    timer = null;
    const hadFocus = element.contains(document.activeElement);
    element.hidden = true;
    setText(said, take ? "Recorded." : "Discarded.");
    if (hadFocus) document.getElementById("record-clip")?.focus();
    if (!take) {
      parts.recorder.cancel();
      return;
    }
    await attempt(parts, async () => {
      const sound = await take();
      taken += 1;
      await giveClip(parts, target, `recording-${taken}.wav`, sound);
    });
  }

  parts.recorder.onFull((sound) => void finish(async () => sound));

  return { element: frame, start };
}
