/** Modes of the clip and of the design at the selected target, as stems and as a table. */

import { gainsAt } from "./design.js";

/** @typedef {import("./main.js").Page} Page */

const SVG = "http://www.w3.org/2000/svg";
const WIDTH = 440;
const HEIGHT = 230;
const LEFT = 38;
const RIGHT = 12;
const TOP = 10;
const BOTTOM = 34;
const FLOOR_DECIBELS = -60;
const UNHEARD_DECIBELS = -100;
const ROUND_HERTZ = [20, 50, 100, 200, 500, 1000, 2000, 5000, 10000, 20000];

/**
 * @param {string} name
 * @param {{[name: string]: string | number}} values
 * @param {string} [text]
 * @returns {SVGElement}
 */
function drawn(name, values, text) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(values)) element.setAttribute(key, String(value));
  if (text !== undefined) element.textContent = text;
  return element;
}

/** @param {number} hertz @returns {string} */
const shown = (hertz) => (hertz < 1000 ? String(hertz) : `${hertz / 1000}k`);

/**
 * @param {HTMLElement} element
 * @param {Page} page
 */
export function makeSpectrum(element, { design, selection }) {
  const legend = document.createElement("p");
  legend.className = "spectrum-legend";
  legend.innerHTML =
    '<span class="wanted">\u25cf clip</span> <span class="now">\u25a1 design</span>';
  const figure = document.createElement("div");
  const more = document.createElement("details");
  more.innerHTML = "<summary>As a table</summary>";
  const table = document.createElement("table");
  more.append(table);
  element.append(legend, figure, more);

  const hertz = [...design.wanted.hertz, ...design.bank.hertz];
  const low = Math.log(Math.min(...hertz) / 1.15);
  const high = Math.log(Math.max(...hertz) * 1.15);
  /** @param {number} value @returns {number} */
  const across = (value) =>
    LEFT + ((WIDTH - LEFT - RIGHT) * (Math.log(value) - low)) / (high - low);
  /** @param {number} decibels @returns {number} */
  const down = (decibels) =>
    TOP + ((HEIGHT - TOP - BOTTOM) * Math.max(FLOOR_DECIBELS, decibels)) / FLOOR_DECIBELS;

  selection.onChange(({ target }) => {
    const number = design.targets.findIndex(({ name }) => name === target);
    if (number < 0) return;
    const wanted = design.wanted.amplitudes[number];
    const now = gainsAt(design, design.targets[number].vertex);
    const loudest = Math.max(...wanted, ...now);
    /** @param {number} amplitude @returns {number} */
    const decibels = (amplitude) => 20 * Math.log10(Math.max(amplitude / loudest, 1e-6));
    const svg = drawn("svg", {
      viewBox: `0 0 ${WIDTH} ${HEIGHT}`,
      role: "img",
      "aria-label": `Modes of the clip and of the design at ${target}; the table below has them all`,
    });
    for (let level = 0; level >= FLOOR_DECIBELS; level -= 20) {
      const y = down(level);
      svg.append(
        drawn("line", { x1: LEFT, x2: WIDTH - RIGHT, y1: y, y2: y, class: "grid" }),
        drawn("text", { x: LEFT - 6, y: y + 4, "text-anchor": "end" }, String(level)),
      );
    }
    for (const value of ROUND_HERTZ) {
      const x = across(value);
      if (x < LEFT || x > WIDTH - RIGHT) continue;
      svg.append(
        drawn("line", { x1: x, x2: x, y1: TOP, y2: HEIGHT - BOTTOM, class: "grid" }),
        drawn("text", { x, y: HEIGHT - BOTTOM + 16, "text-anchor": "middle" }, shown(value)),
      );
    }
    const middle = (LEFT + WIDTH - RIGHT) / 2;
    const caption = "Hz across, decibels below the loudest down";
    svg.append(drawn("text", { x: middle, y: HEIGHT - 3, "text-anchor": "middle" }, caption));
    const foot = down(FLOOR_DECIBELS);
    for (const [mode, amplitude] of wanted.entries()) {
      if (decibels(amplitude) < FLOOR_DECIBELS) continue;
      const [x, y] = [across(design.wanted.hertz[mode]), down(decibels(amplitude))];
      svg.append(
        drawn("line", { x1: x, x2: x, y1: foot, y2: y, class: "stem wanted" }),
        drawn("circle", { cx: x, cy: y, r: 4, class: "mark wanted" }),
      );
    }
    for (const [mode, amplitude] of now.entries()) {
      if (decibels(amplitude) < FLOOR_DECIBELS) continue;
      const [x, y] = [across(design.bank.hertz[mode]), down(decibels(amplitude))];
      svg.append(
        drawn("line", { x1: x, x2: x, y1: foot, y2: y, class: "stem now" }),
        drawn("rect", { x: x - 4, y: y - 4, width: 8, height: 8, class: "mark now" }),
      );
    }
    figure.replaceChildren(svg);
    fill(table, design, wanted, now, decibels);
  });
}

/**
 * @param {HTMLTableElement} table
 * @param {import("./design.js").Design} design
 * @param {number[]} wanted
 * @param {Float32Array} now
 * @param {(amplitude: number) => number} decibels
 */
function fill(table, design, wanted, now, decibels) {
  table.replaceChildren();
  const heads = ["Clip [Hz]", "Design [Hz]", "Cents apart", "Clip [dB]", "Design [dB]"];
  const top = table.createTHead().insertRow();
  for (const head of heads) {
    const cell = document.createElement("th");
    cell.scope = "col";
    cell.textContent = head;
    top.append(cell);
  }
  const body = table.createTBody();
  for (const [mode, amplitude] of wanted.entries()) {
    const row = body.insertRow();
    const off = design.cents[mode] ?? null;
    row.insertCell().textContent = off === null ? "silent" : told(design.wanted.hertz[mode]);
    row.insertCell().textContent = told(design.bank.hertz[mode]);
    row.insertCell().textContent = off === null ? "" : told(off);
    for (const level of [amplitude, now[mode]].map(decibels)) {
      row.insertCell().textContent = level < UNHEARD_DECIBELS ? "none" : told(level);
    }
  }
}

/** @param {number} value @returns {string} */
const told = (value) => (Math.round(10 * value) / 10 || 0).toFixed(1);
