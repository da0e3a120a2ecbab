/** Numbers of sounds and how they are written. */

const CENTS = 1200;
const MINUS = "\u2212";
const NOTHING = "\u2013";
/** A smaller fall is none that is worth to be told. */
const LEAST_PERCENT = 0.05;

/**
 * Distance of a frequency above another one [cents].
 *
 * @param {number} hertz
 * @param {number} wanted [Hz]
 */
export function cents(hertz, wanted) {
  return CENTS * Math.log2(hertz / wanted);
}

/**
 * Critical-band rate [bark] (Zwicker and Terhardt 1980), as the cost has it.
 *
 * @param {number} hertz
 */
export function bark(hertz) {
  return 13 * Math.atan((hertz * 0.76) / 1000) + 3.5 * Math.atan((hertz / 7500) ** 2);
}

/**
 * Level of an amplitude below another one [dB].
 *
 * @param {number} amplitude
 * @param {number} loudest
 */
export function decibels(amplitude, loudest) {
  return 20 * Math.log10(Math.abs(amplitude) / Math.abs(loudest));
}

/**
 * Time in which a mode falls by 60 dB [s].
 *
 * @param {number} dampingPerSecond
 */
export function decaySeconds(dampingPerSecond) {
  return Math.log(1000) / dampingPerSecond;
}

/** Units of lengths, and the least longest length that is told in each [m]. @type {[string, number, number][]} */
const LENGTHS = [
  ["m", 1, 1],
  ["cm", 0.01, 0.01],
  ["mm", 0.001, 1e-5],
  ["\u00b5m", 1e-6, 0],
];

/**
 * Lengths, as of the sides of a box, in the unit that suits the longest of them.
 *
 * @param {readonly number[]} metres
 */
export function lengths(metres) {
  const longest = Math.max(...metres);
  const [unit, size] = LENGTHS.find(([, , least]) => longest >= least) ?? ["m", 1];
  return `${metres.map((each) => Number((each / size).toPrecision(3))).join(" \u00d7 ")} ${unit}`;
}

/**
 * The largest magnitude of a list; 0 if it is empty.
 *
 * @param {ArrayLike<number>} values
 */
export function largest(values) {
  let most = 0;
  for (let k = 0; k < values.length; k += 1) {
    const value = Math.abs(values[k] ?? 0);
    if (value > most) most = value;
  }
  return most;
}

/**
 * Root mean square; 0 if there is none.
 *
 * @param {ArrayLike<number>} values
 */
export function rootMeanSquare(values) {
  let sum = 0;
  for (let k = 0; k < values.length; k += 1) sum += (values[k] ?? 0) ** 2;
  return values.length ? Math.sqrt(sum / values.length) : 0;
}

/**
 * A number with so many places behind the point; a dash if it is none.
 *
 * @param {number | null | undefined} value
 * @param {number} places
 * @param {boolean} [signed] whether positive ones have a sign, too
 */
export function fixed(value, places, signed = false) {
  if (value === null || value === undefined || !Number.isFinite(value)) return NOTHING;
  const text = Math.abs(value).toFixed(places);
  if (Number(text) === 0) return text;
  if (value < 0) return MINUS + text;
  return signed ? `+${text}` : text;
}

/**
 * A number with so many significant digits, without needless noughts.
 *
 * @param {number | null | undefined} value
 * @param {number} [digits]
 */
export function significant(value, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return NOTHING;
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-3) {
    const [mantissa = "", exponent = ""] = size.toExponential(digits - 1).split("e");
    const power = exponent.replace("+", "").replace("-", MINUS);
    return `${value < 0 ? MINUS : ""}${mantissa}\u00d710^${power}`;
  }
  const text = size.toLocaleString("en", { maximumSignificantDigits: digits });
  return value < 0 ? MINUS + text : text;
}

/**
 * A frequency with its unit.
 *
 * @param {number | null | undefined} hertz
 */
export function withHertz(hertz) {
  return `${fixed(hertz, hertz && hertz < 10_000 ? 1 : 0)} Hz`;
}

/**
 * A time with its unit: seconds, or minutes and seconds.
 *
 * @param {number} seconds
 */
export function withSeconds(seconds) {
  if (seconds < 60) return `${fixed(seconds, seconds < 10 ? 1 : 0)} s`;
  const whole = Math.round(seconds);
  return `${Math.floor(whole / 60)} min ${whole % 60} s`;
}

/**
 * How far a cost is from the first one, in words.
 *
 * @param {number} first
 * @param {number} last
 */
export function change(first, last) {
  const fall = first > 0 ? 100 * (1 - last / first) : 0;
  if (Math.abs(fall) < LEAST_PERCENT) return "as at first";
  if (fall < 0) return `${fixed(-fall, 1)} % above the first one`;
  return `${fixed(fall, fall > 99 ? 2 : 1)} % below the first one`;
}
