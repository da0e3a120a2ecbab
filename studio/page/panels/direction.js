/** A direction around a head: in words, and drawn from above and from the side. */

import { make } from "./dom.js";

/** @typedef {import("../types.js").Vector} Vector ahead, left, up */

const SVG = "http://www.w3.org/2000/svg";
const CENTRE = 60;
const FAR = 46;
const NEAR_DEGREES = 5;
const STEEP_DEGREES = 80;
/** Ring, head, nose and ears, with the nose to the top. */
const FROM_ABOVE = "M60 34 54 44H66z M43 54h-4v12h4z M77 54h4v12h-4z";
/** The same with the nose to the right. */
const FROM_THE_RIGHT = "M86 60 76 54V66z";

/**
 * A direction in words.
 *
 * @param {Vector} direction
 * @returns {string}
 */
export function directionWords([ahead, left, up]) {
  const elevation = Math.round((Math.asin(Math.max(-1, Math.min(1, up))) * 180) / Math.PI);
  if (Math.abs(elevation) > STEEP_DEGREES) return elevation > 0 ? "straight above" : "straight below";
  const azimuth = Math.round((Math.atan2(left, ahead) * 180) / Math.PI);
  const away = Math.abs(azimuth);
  const side = azimuth > 0 ? "left" : "right";
  let words = away > 90 ? `behind on the ${side} (${away}\u00b0)` : `${away}\u00b0 to the ${side}`;
  if (away <= NEAR_DEGREES) words = "ahead";
  if (away >= 180 - NEAR_DEGREES) words = "behind";
  if (Math.abs(elevation) <= NEAR_DEGREES) return words;
  return `${words}, ${Math.abs(elevation)}\u00b0 ${elevation > 0 ? "up" : "down"}`;
}

/**
 * Makes both drawings.
 *
 * @returns {{ element: HTMLElement, show: (direction: Vector) => void }}
 */
export function makeDirection() {
  const above = makeView("Seen from above", FROM_ABOVE);
  const side = makeView("Seen from the right", FROM_THE_RIGHT);
  return {
    element: make("div", { class: "direction" }, above.element, side.element),
    show(direction) {
      const [ahead, left, up] = direction;
      const words = directionWords(direction);
      above.show(-left, -ahead, words);
      side.show(ahead, -up, words);
    },
  };
}

/**
 * @param {string} title
 * @param {string} outline of nose and ears
 * @returns {{ element: HTMLElement, show: (x: number, y: number, words: string) => void }}
 */
function makeView(title, outline) {
  const way = shape("line", { class: "direction-way", x1: CENTRE, y1: CENTRE });
  const source = shape("circle", { class: "direction-source", r: 7 });
  const picture = shape("svg", { viewBox: "0 0 120 120", role: "img" });
  picture.append(
    shape("circle", { class: "direction-ring", cx: CENTRE, cy: CENTRE, r: FAR }),
    shape("path", { class: "direction-head", d: outline }),
    shape("circle", { class: "direction-head", cx: CENTRE, cy: CENTRE, r: 17 }),
    way,
    source,
  );
  return {
    element: make("figure", {}, picture, make("figcaption", { class: "hint" }, title)),
    show(x, y, words) {
      const [right, down] = [CENTRE + FAR * x, CENTRE + FAR * y];
      set(way, { x2: right, y2: down });
      set(source, { cx: right, cy: down });
      set(picture, { "aria-label": `${title}: the sound comes from ${words}` });
    },
  };
}

/** @param {string} name @param {Record<string, string | number>} attributes @returns {SVGElement} */
function shape(name, attributes) {
  const element = document.createElementNS(SVG, name);
  set(/** @type {SVGElement} */ (element), attributes);
  return /** @type {SVGElement} */ (element);
}

/** @param {SVGElement} element @param {Record<string, string | number>} attributes */
function set(element, attributes) {
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
}
