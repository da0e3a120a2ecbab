/**
 * The colour map of Young's modulus: from dark violet over teal to light yellow.
 *
 * Lightness rises evenly in Oklab (Ottosson, 2020), so the map is read without telling hues apart; steps
 * along it are of one size to the eye.
 */

const STEPS = 256;
const LIGHTNESS = [0.3, 0.93];
const HUE_DEGREES = [300, 100];
const CHROMA = 0.15;

// A uniform solid gets the middle of a decade, as nothing stands out there.
const LEAST_DECADES = 1;

/**
 * Linear red, green and blue of a colour of Oklab; beyond 0 to 1 where screens have none.
 *
 * @param {number} lightness
 * @param {number} a
 * @param {number} b
 * @returns {[number, number, number]}
 */
function linear(lightness, a, b) {
  const l = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3;
  const m = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3;
  const s = (lightness - 0.0894841775 * a - 1.291485548 * b) ** 3;
  return [
    4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
    -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
    -0.0041960863 * l - 0.7034186147 * m + 1.707614701 * s,
  ];
}

/** @param {number} share of the way along the map @returns {[number, number, number]} Oklab */
function along(share) {
  const lightness = LIGHTNESS[0] + share * (LIGHTNESS[1] - LIGHTNESS[0]);
  const hue = ((HUE_DEGREES[0] + share * (HUE_DEGREES[1] - HUE_DEGREES[0])) * Math.PI) / 180;
  let chroma = CHROMA;
  const shown = () => linear(lightness, chroma * Math.cos(hue), chroma * Math.sin(hue));
  while (shown().some((value) => value < 0 || value > 1)) chroma -= 0.001;
  return [lightness, chroma * Math.cos(hue), chroma * Math.sin(hue)];
}

/** @returns {Float32Array} linear red, green and blue of `STEPS` colours, evenly apart */
function makeMap() {
  const fine = Array.from({ length: 4 * STEPS }, (_, i) => along(i / (4 * STEPS - 1)));
  const lengths = [0];
  for (let i = 1; i < fine.length; i++) {
    const [p, q] = [fine[i - 1], fine[i]];
    lengths.push(lengths[i - 1] + Math.hypot(q[0] - p[0], q[1] - p[1], q[2] - p[2]));
  }
  const map = new Float32Array(3 * STEPS);
  for (let step = 0, i = 1; step < STEPS; step++) {
    const wanted = (step / (STEPS - 1)) * lengths[lengths.length - 1];
    while (i < fine.length - 1 && lengths[i] < wanted) i++;
    const share = (wanted - lengths[i - 1]) / (lengths[i] - lengths[i - 1]);
    const [l, a, b] = [0, 1, 2].map((j) => fine[i - 1][j] + share * (fine[i][j] - fine[i - 1][j]));
    map.set(linear(l, a, b).map((value) => Math.min(1, Math.max(0, value))), 3 * step);
  }
  return map;
}

/** Linear red, green and blue, one colour after another. */
export const MAP = makeMap();

/**
 * What the colours span: decadic logarithms of moduli in Pa.
 *
 * Wider than the moduli, and kept while they still fill half of it, so that colours do not drift with
 * every improvement.
 *
 * @param {Float32Array} young moduli [Pa]
 * @param {[number, number] | null} before
 * @returns {[number, number]}
 */
export function span(young, before) {
  let [least, most] = [Infinity, 0];
  for (const value of young) {
    if (value < least) least = value;
    if (value > most) most = value;
  }
  let [low, high] = [Math.log10(least), Math.log10(most)];
  const wanting = LEAST_DECADES - (high - low);
  if (wanting > 0) [low, high] = [low - wanting / 2, high + wanting / 2];
  if (before && before[0] <= low && high <= before[1] && 2 * (high - low) >= before[1] - before[0]) {
    return before;
  }
  return wanting > 0 ? [low, high] : [Math.floor(10 * low) / 10, Math.ceil(10 * high) / 10];
}

/**
 * Writes the colours of moduli.
 *
 * @param {Float32Array} colours linear red, green and blue of each of `sources`; written
 * @param {Float32Array} young moduli [Pa]
 * @param {Uint32Array} sources whose modulus it is
 * @param {[number, number]} spanned decadic logarithms
 */
export function paint(colours, young, sources, spanned) {
  const scale = (STEPS - 1) / (spanned[1] - spanned[0]);
  for (let i = 0; i < sources.length; i++) {
    const at = Math.round((Math.log10(young[sources[i]]) - spanned[0]) * scale);
    const step = 3 * Math.min(STEPS - 1, Math.max(0, at));
    colours[3 * i] = MAP[step];
    colours[3 * i + 1] = MAP[step + 1];
    colours[3 * i + 2] = MAP[step + 2];
  }
}

/** @param {number} value linear @returns {number} as screens take it, 0 to 255 */
function encoded(value) {
  return 255 * (value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055);
}

/** @param {number} share of the way along the map @returns {string} the colour for styles */
export function style(share) {
  const step = 3 * Math.round(share * (STEPS - 1));
  const [red, green, blue] = MAP.slice(step, step + 3).map(encoded);
  return `rgb(${red.toFixed()} ${green.toFixed()} ${blue.toFixed()})`;
}
