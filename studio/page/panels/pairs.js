/** Modes of the solid beside those that are wanted of them. */

import { bark, cents, decibels, largest } from "./numbers.js";

/** @typedef {import("../types.js").BankHeader} BankHeader */
/** @typedef {import("../types.js").BankArrays} BankArrays */
/** @typedef {import("../types.js").State} State */

/**
 * A mode of the solid; levels are below the loudest of all at the target, as the cost has them. What is
 * `null` is not wanted of it, or nobody knows.
 *
 * @typedef {object} Pair
 * @property {number} mode its number, from 0
 * @property {number} hertz
 * @property {number | null} decibels
 * @property {number | null} wantedHertz
 * @property {number | null} wantedDecibels
 * @property {number | null} cents above what is wanted
 * @property {number | null} bark above what is wanted
 */

/** What a level is called that is no sound at all [dB]. */
const SILENT = -200;

/**
 * Modes of a bank and what is wanted of them at a target.
 *
 * @param {BankHeader} header
 * @param {BankArrays} arrays
 * @param {State | null} state
 * @param {string | null} target its name
 * @returns {Pair[]}
 */
export function pairsOf(header, arrays, state, target) {
  const count = arrays.hertz.length;
  const row = target === null ? -1 : header.targets.indexOf(target);
  const gains = row < 0 ? null : arrays.struck.subarray(row * count, (row + 1) * count);
  const levels = gains && levelsOf(gains);
  const wanted = header.wanted_hertz;
  const place = state?.targets.findIndex((each) => each.name === target) ?? -1;
  const amplitudes = wanted && place >= 0 ? (state?.wanted?.amplitudes[place] ?? null) : null;
  const wantedLevels = amplitudes && levelsOf(amplitudes);
  return Array.from(arrays.hertz, (hertz, mode) => {
    const wantedHertz = wanted?.[mode] ?? null;
    return {
      mode,
      hertz,
      decibels: levels?.[mode] ?? null,
      wantedHertz,
      wantedDecibels: wantedHertz === null ? null : (wantedLevels?.[mode] ?? null),
      cents: wantedHertz === null ? null : (header.cents?.[mode] ?? cents(hertz, wantedHertz)),
      bark: wantedHertz === null ? null : (header.bark?.[mode] ?? bark(hertz) - bark(wantedHertz)),
    };
  });
}

/**
 * How much louder a mode is than wanted [dB]; `null` if one of both is not known.
 *
 * @param {Pair} pair
 */
export function levelDifference(pair) {
  if (pair.decibels === null || pair.wantedDecibels === null) return null;
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
