/** The list of bodies, and that of the last impacts. */

import { GROUND, begun } from "./content.js";
import * as shown from "./numbers.js";

/** @typedef {import("./content.js").Body} Body */
/** @typedef {import("./content.js").Scene} Scene */

const MOST_IMPACTS = 8;
const HIGHEST_HEARD = 20_000; // Hz

/**
 * @param {HTMLElement} element
 * @param {Body[]} bodies
 * @param {(body: Body) => void} strike
 */
export function listBodies(element, bodies, strike) {
  for (const body of bodies) {
    const item = document.createElement("li");
    const row = document.createElement(body.voice ? "button" : "div");
    row.className = "body";
    const colour = document.createElement("span");
    colour.className = "colour";
    const parts = body.colour.map((part) => `${Math.round(100 * part)}%`);
    colour.style.background = `rgb(${parts.join(" ")})`;
    const name = document.createElement("span");
    name.className = "name";
    name.textContent = body.name;
    const says = document.createElement("span");
    says.className = "quiet";
    says.textContent = soundOf(body);
    row.append(colour, name, says);
    if (row instanceof HTMLButtonElement) {
      row.type = "button";
      row.title = `Strike ${body.name}`;
      row.onclick = () => strike(body);
    }
    item.append(row);
    element.append(item);
  }
}

/** @param {Body} body @returns {string} */
function soundOf({ voice }) {
  if (!voice) return "silent";
  const hertz = Math.min(...voice.hertz);
  const lowest = shown.frequency(hertz) + (hertz > HIGHEST_HEARD ? ", which nobody hears" : "");
  const { length } = voice.hertz;
  const says = length === 1 ? `1 mode, ${lowest}` : `${length} modes from ${lowest}`;
  return voice.expectedCents === null ? says : `${says}, about ${shown.cents(voice.expectedCents)} off`;
}

/**
 * @param {HTMLElement} element
 * @param {Scene} scene
 * @returns {{show: (seconds: number) => void}}
 */
export function listImpacts(element, { impacts, bodies }) {
  const table = document.createElement("table");
  table.innerHTML =
    "<thead><tr><th scope='col'>Time</th><th scope='col'>Impact</th>" +
    "<th scope='col'>Impulse</th><th scope='col'>Contact</th></tr></thead>";
  const rows = table.createTBody();
  const nothing = document.createElement("p");
  nothing.className = "quiet";
  nothing.textContent = impacts.length > 0 ? "Nothing has struck yet." : "Nothing strikes.";
  element.append(table, nothing);
  /** @param {number} number */
  const nameOf = (number) => (number === GROUND ? "ground" : bodies[number].name);
  let before = -1;
  return {
    show(seconds) {
      const count = begun(impacts, seconds);
      if (count === before) return;
      before = count;
      nothing.hidden = count > 0;
      table.hidden = count === 0;
      rows.replaceChildren();
      for (const { seconds: at, pair, impulse, duration } of impacts
        .slice(Math.max(0, count - MOST_IMPACTS), count)
        .reverse()) {
        const row = rows.insertRow();
        const says = [
          `${shown.time(at)} s`,
          `${nameOf(pair[0])} on ${nameOf(pair[1])}`,
          shown.impulse(impulse),
          shown.milliseconds(duration),
        ];
        for (const text of says) row.insertCell().textContent = text;
      }
    },
  };
}
