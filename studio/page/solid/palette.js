/** Colours that tell regions apart. */

/** @typedef {import("../types.js").Vector} Vector */

/** Of a region whose material has none. @type {Vector} */
export const NO_COLOUR = [0.62, 0.66, 0.68];

// Okabe and Ito's, which all eyes tell apart, then lighter and darker ones.
/** @type {readonly Vector[]} */
const OTHERS = [
  [0.9, 0.62, 0],
  [0.34, 0.71, 0.91],
  [0, 0.62, 0.45],
  [0.94, 0.89, 0.26],
  [0, 0.45, 0.7],
  [0.84, 0.37, 0],
  [0.8, 0.47, 0.65],
  [0.45, 0.3, 0.2],
  [0.6, 0.8, 0.6],
  [0.75, 0.7, 0.9],
];
// Less than this between two colours, each 0 to 1 in three channels, and they look alike.
const ALIKE = 0.16;

/**
 * A colour that is not like others: the wanted one, or else the first that stands out.
 *
 * @param {Vector} wanted
 * @param {readonly Vector[]} others
 * @returns {Vector}
 */
export function apart(wanted, others) {
  /** @param {Vector} one */
  const least = (one) =>
    Math.min(Infinity, ...others.map((other) => Math.hypot(...one.map((value, i) => value - other[i]))));
  if (least(wanted) > ALIKE) return wanted;
  const free = OTHERS.filter((one) => least(one) > ALIKE);
  return free[0] ?? OTHERS[others.length % OTHERS.length];
}

/** @param {Vector} colour sRGB, 0 to 1 @returns {string} for styles */
export function styleOf(colour) {
  return `rgb(${colour.map((value) => Math.round(255 * value)).join(" ")})`;
}
