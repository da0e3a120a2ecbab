/** Modes of the solid beside those that are wanted of them. */

import { bark, cents, decibels, largest } from "./numbers.js";

/** @typedef {import("../types.js").BankHeader} BankHeader */
/** @typedef {import("../types.js").BankArrays} BankArrays */
/** @typedef {import("../types.js").State} State */

/**
 * A mode of the solid; levels are below the loudest of all at the point, as the cost has them. What is
 * `null` is not wanted of it, or not there.
 *
 * @typedef {object} Pair
 * @property {number} mode its number, from 0
 * @property {number} hertz
 * @property {number} decibels
 * @property {number | null} wantedHertz
 * @property {number | null} wantedDecibels
 * @property {number | null} cents above what is wanted
 * @property {number | null} bark above what is wanted
 */

/** What a level is called that is no sound at all [dB]. */
const SILENT = -100;

/**
 * Modes of a bank and what is wanted of them at a point.
 *
 * @param {BankHeader} header
 * @param {BankArrays} arrays
 * @param {State | null} state
 * @param {{ name: string | null, vertex: number }} point a target, or any vertex
 * @returns {Pair[]} none if the solid has no such vertex
 */
export function pairsOf(header, arrays, state, { name, vertex }) {
  const count = arrays.hertz.length;
  const gains = arrays.gains.subarray(vertex * count, (vertex + 1) * count);
  if (gains.length !== count) return [];
  const levels = levelsOf(gains);
  const wanted = header.wanted_hertz;
  // Amplitudes are wanted of those targets alone that have a clip: the bank names them in their order.
  const row = name === null ? -1 : header.targets.indexOf(name);
  const amplitudes = wanted && row >= 0 ? (state?.wanted?.amplitudes[row] ?? null) : null;
  const wantedLevels = amplitudes && levelsOf(amplitudes);
  return Array.from(arrays.hertz, (hertz, mode) => {
    const wantedHertz = wanted?.[mode] ?? null;
    return {
      mode,
      hertz,
      decibels: levels[mode] ?? SILENT,
      wantedHertz,
      wantedDecibels: wantedLevels?.[mode] ?? null,
      cents: wantedHertz === null ? null : (header.cents?.[mode] ?? cents(hertz, wantedHertz)),
      bark: wantedHertz === null ? null : (header.bark?.[mode] ?? bark(hertz) - bark(wantedHertz)),
    };
  });
}

/**
 * How much louder a mode is than wanted [dB]; `null` if nothing is wanted there.
 *
 * @param {Pair} pair
 * @returns {number | null}
 */
export function levelDifference(pair) {
  if (pair.wantedDecibels === null) return null;
  if (pair.decibels <= SILENT && pair.wantedDecibels <= SILENT) return 0;
  return pair.decibels - pair.wantedDecibels;
}

/** @param {ArrayLike<number>} amplitudes */
function levelsOf(amplitudes) {
  const loudest = largest(amplitudes);
  return Array.from(amplitudes, (amplitude) =>
    amplitude === 0 ? SILENT : Math.max(SILENT, decibels(amplitude, loudest)),
  );
}
