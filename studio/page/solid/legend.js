/** The legend of the colours: a bar with moduli in GPa, and the one under the pointer; or the regions. */

import { style } from "./colours.js";

const STOPS = 24;
const MOST_TICKS = 6;

/** @param {number} pascals @returns {string} in GPa */
export function gigapascals(pascals) {
  return String(Number((pascals / 1e9).toPrecision(2)));
}

/**
 * Round moduli within a span.
 *
 * @param {[number, number]} spanned decadic logarithms of moduli [Pa]
 * @returns {number[]} moduli [Pa], not more than fit
 */
export function ticks([low, high]) {
  for (const digits of [[1, 2, 5], [1, 3], [1]]) {
    const found = [];
    for (let decade = Math.floor(low); decade <= high; decade++) {
      for (const digit of digits) {
        const value = digit * 10 ** decade;
        if (Math.log10(value) >= low && Math.log10(value) <= high) found.push(value);
      }
    }
    if (found.length <= MOST_TICKS) return found;
  }
  const step = Math.ceil((high - low) / MOST_TICKS);
  const first = Math.ceil(low / step) * step;
  return Array.from({ length: Math.floor((high - first) / step) + 1 }, (_, i) => 10 ** (first + i * step));
}

/**
 * @param {HTMLElement} element
 * @returns {{show: (spanned: [number, number] | null) => void, point: (pascals: number | null) => void,
 *     list: (entries: {text: string, style: string, hatch?: number}[]) => void}} `show` tells what the ends of the map
 *     stand for, `point` which modulus is under the pointer, `list` which regions there are in place of that
 */
export function makeLegend(element) {
  element.className = "stage-legend";
  element.hidden = true;
  element.innerHTML = `
    <p class="legend-title">Young's modulus [GPa] <output class="legend-value"></output></p>
    <div class="legend-bar"><span class="legend-pointer" hidden></span></div>
    <div class="legend-ticks"></div>
    <ul class="legend-list" hidden></ul>`;
  const list = /** @type {HTMLElement} */ (element.querySelector(".legend-list"));
  const scale = [...element.children].filter((child) => child !== list);
  /** @param {boolean} isList */
  const turn = (isList) => {
    list.hidden = !isList;
    for (const part of scale) /** @type {HTMLElement} */ (part).hidden = isList;
  };
  const bar = /** @type {HTMLElement} */ (element.querySelector(".legend-bar"));
  const marks = /** @type {HTMLElement} */ (element.querySelector(".legend-ticks"));
  const value = /** @type {HTMLElement} */ (element.querySelector(".legend-value"));
  const pointer = /** @type {HTMLElement} */ (element.querySelector(".legend-pointer"));
  const stops = Array.from({ length: STOPS }, (_, i) => style(i / (STOPS - 1)));
  bar.style.background = `linear-gradient(to right, ${stops.join(", ")})`;
  /** @type {[number, number] | null} */
  let shown = null;
  /** @param {number} pascals */
  const share = (pascals) => (shown ? (Math.log10(pascals) - shown[0]) / (shown[1] - shown[0]) : 0);

  return {
    list(entries) {
      element.hidden = entries.length === 0;
      turn(true);
      list.replaceChildren(
        ...entries.map(({ text, style: colour, hatch }) => {
          const entry = document.createElement("li");
          const chip = document.createElement("span");
          chip.className = hatch ? `chip hatch-${hatch}` : "chip";
          chip.style.background = hatch ? "" : colour;
          entry.append(chip, text);
          return entry;
        }),
      );
    },
    show(spanned) {
      element.hidden = spanned === null;
      turn(false);
      if (spanned === null || spanned === shown) return;
      shown = spanned;
      marks.replaceChildren(
        ...ticks(spanned).map((tick) => {
          const mark = document.createElement("span");
          mark.textContent = gigapascals(tick);
          mark.style.left = `${(100 * share(tick)).toFixed(2)}%`;
          return mark;
        }),
      );
    },
    point(pascals) {
      value.textContent = pascals === null ? "" : `here ${gigapascals(pascals)}`;
      pointer.hidden = pascals === null;
      if (pascals !== null) pointer.style.left = `${(100 * share(pascals)).toFixed(2)}%`;
    },
  };
}
