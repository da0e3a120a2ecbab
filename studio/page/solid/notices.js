/** What lies over the view: how far preparation is, what failed, what to do with an empty page. */

import { lengths } from "../panels/numbers.js";
import { fillChooser } from "./chooser.js";

/** @typedef {import("../main.js").Parts} Parts */
/** @typedef {import("../types.js").State} State */

/** @type {Record<string, string>} */
const PHASES = {
  reading: "Reading the solid",
  preparing: "Preparing the solid: it becomes voxels, then these become coarser elements",
  ready: "Computing the modes",
};

/**
 * @param {HTMLElement} element
 * @param {Parts} parts
 * @param {() => boolean} silent whether the solid's modes are not there yet
 * @returns {{graphics: (sentence: string | null) => void, show: () => void}} `graphics` is told what keeps the
 *     solid from being drawn, `show` that `silent` says something else
 */
export function makeNotices(element, parts, silent) {
  element.className = "notices";
  element.innerHTML = `
    <div class="empty" hidden>
      <h2>I want to make sounds</h2>
      <p>Open an example or a solid of your own, and press anywhere on it: it sounds. To make it sound like a
        recording, give that to the point that was struck, and press <em>Optimise</em>.</p>
      <div class="chooser"></div>
    </div>
    <div class="notice progress" hidden>
      <p id="progress-says" role="status"></p>
      <progress aria-labelledby="progress-says"></progress>
    </div>
    <div class="notice fault" role="alert" hidden>
      <p></p>
      <button type="button">Open another solid</button>
    </div>
    <div class="notice graphics" role="alert" hidden><p></p></div>`;
  /** @param {string} selector @returns {HTMLElement} */
  const part = (selector) => /** @type {HTMLElement} */ (element.querySelector(selector));
  const [empty, progress, fault, graphics] = [".empty", ".progress", ".fault", ".graphics"].map(part);
  const bar = /** @type {HTMLProgressElement} */ (element.querySelector("progress"));
  part(".fault button").onclick = () => parts.view?.openChooser();

  /** What the chooser offers; it is made anew only when this changes, for the sake of the focus. */
  let offered = "";
  /** @param {State} now */
  const show = (now) => {
    const { solid } = now;
    empty.hidden = solid !== null;
    const offers = JSON.stringify([now.builtins, now.examples, now.projects]);
    if (!solid && offers !== offered) {
      offered = offers;
      fillChooser(part(".empty .chooser"), parts, () => parts.say("Opening."));
    }
    const underway = solid !== null && solid.phase in PHASES && (solid.phase !== "ready" || silent());
    progress.hidden = !underway;
    if (solid && underway) {
      const length = solid.longest_side_m;
      const size = length ? ` (${lengths([length])} long)` : "";
      const says = solid.message ?? `${PHASES[solid.phase]}${size}`;
      if (part("#progress-says").textContent !== says) part("#progress-says").textContent = says;
      if (solid.progress === null) bar.removeAttribute("value");
      else bar.value = solid.progress;
    }
    fault.hidden = solid?.phase !== "failed";
    if (solid?.phase === "failed") {
      const says = solid.message ?? "The solid could not be prepared: try another one.";
      if (part(".fault p").textContent !== says) part(".fault p").textContent = says;
    }
  };
  parts.state.onChange(show);

  return {
    show() {
      if (parts.state.current) show(parts.state.current);
    },
    graphics(sentence) {
      graphics.hidden = sentence === null;
      part(".graphics p").textContent = sentence ?? "";
    },
  };
}
