/** Numbers as people read them. */

/** @type {[number, string][]} */
const IMPULSES = [
  [1, "N s"],
  [1e-3, "mN s"],
  [1e-6, "µN s"],
];
/** @type {[number, string][]} */
const LENGTHS = [
  [1, "m"],
  [1e-2, "cm"],
  [1e-3, "mm"],
];

/** @param {number} value @param {[number, string][]} units the largest one first @returns {string} */
function inUnits(value, units) {
  const [unit, name] = units.find(([size]) => value >= 0.9995 * size) ?? units[units.length - 1];
  return `${short(value / unit)} ${name}`;
}

/** @param {number} value @returns {string} with two digits that count, and all before the point */
function short(value) {
  if (value >= 9.95) return value.toFixed(0);
  return value >= 0.095 ? value.toFixed(value >= 0.995 ? 1 : 2) : String(Number(value.toPrecision(1)));
}

/** @param {number} value [N s] @returns {string} */
export const impulse = (value) => inUnits(value, IMPULSES);

/** @param {number} value [m] @returns {string} */
export const length = (value) => inUnits(value, LENGTHS).replace(".0", "");

/** @param {number} seconds @returns {string} */
export const milliseconds = (seconds) => `${short(1000 * seconds)} ms`;

/** @param {number} hertz @returns {string} */
export const frequency = (hertz) =>
  hertz < 1000 ? `${hertz.toFixed(0)} Hz` : `${(hertz / 1000).toFixed(2)} kHz`;

/** @param {number} value @returns {string} */
export const cents = (value) => `${short(value)} cents`;

/** @param {number} seconds @returns {string} */
export const time = (seconds) => seconds.toFixed(2);

/** @param {number} count @param {string} one @param {string} many @returns {string} */
export const counted = (count, one, many) => `${count} ${count === 1 ? one : many}`;
