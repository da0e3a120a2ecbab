/** The timeline: where the scene is, where impacts are, and where else it may go. */

import * as shown from "./numbers.js";

/** @typedef {import("./playback.js").Playback} Playback */

const SVG = "http://www.w3.org/2000/svg";
const WIDTH = 1000;
const HEIGHT = 100;
/** Of the height, of an impact that is next to nothing. */
const LEAST = 0.08;

/**
 * Marks as tall as the root of their share of the largest impulse, so that small ones are seen.
 *
 * @param {import("./content.js").Impact[]} impacts
 * @param {number} seconds How long the scene takes.
 * @returns {string} A path.
 */
export function marksOf(impacts, seconds) {
  const largest = Math.max(...impacts.map(({ impulse }) => impulse), Number.MIN_VALUE);
  const marks = impacts.map(({ seconds: at, impulse }) => {
    const tall = HEIGHT * Math.max(LEAST, Math.sqrt(impulse / largest));
    return `M${((WIDTH * at) / seconds).toFixed(2)} ${HEIGHT}v${(-tall).toFixed(1)}`;
  });
  return marks.join("");
}

/**
 * @param {HTMLElement} element
 * @param {import("./content.js").Scene} scene
 * @param {Playback} playback
 * @returns {{show: (seconds: number) => void, input: HTMLInputElement}}
 */
export function makeTimeline(element, { impacts, seconds }, playback) {
  const path = marksOf(impacts, seconds);
  for (const name of ["coming", "passed"]) {
    const svg = document.createElementNS(SVG, "svg");
    svg.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
    svg.setAttribute("preserveAspectRatio", "none");
    svg.setAttribute("class", name);
    svg.setAttribute("aria-hidden", "true");
    const marks = document.createElementNS(SVG, "path");
    marks.setAttribute("d", path);
    svg.append(marks);
    element.append(svg);
  }
  const input = document.createElement("input");
  input.type = "range";
  input.min = "0";
  input.max = String(seconds);
  input.step = "any";
  input.value = "0";
  input.setAttribute("aria-label", `Time; ${shown.counted(impacts.length, "impact", "impacts")}`);
  element.append(input);
  input.addEventListener("pointerdown", () => playback.hold());
  for (const name of ["pointerup", "pointercancel"]) {
    addEventListener(name, () => playback.letGo(), { capture: true });
  }
  input.addEventListener("input", () => playback.seek(Number(input.value)));
  return {
    input,
    show(at) {
      input.value = String(at);
      input.setAttribute("aria-valuetext", `${shown.time(at)} of ${shown.time(seconds)} seconds`);
      element.style.setProperty("--share", String(at / seconds));
    },
  };
}
