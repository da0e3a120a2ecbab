/** Why the cost of a search rises here and there, in words. */

import { fixed, significant, withSeconds } from "./numbers.js";

/** @typedef {import("../types.js").Progress} Progress */
/** @typedef {import("../types.js").FineCheck} FineCheck */

/** Analyses of a search are inexact: a smaller rise, over the cost, has no reason. */
const LEAST_RISE = 1e-3;
/** The last ones are told; those before are of the same kinds. */
const MOST_TOLD = 3;

/**
 * Sentences that tell what the curve of the cost is of, and why it rises.
 *
 * @param {readonly Pick<Progress, "seconds" | "cost">[]} rows
 * @param {readonly FineCheck[]} checks on the fine solid
 * @param {number | null} present cost on the fine solid of the material that sounds
 * @returns {string[]}
 */
export function explanations(rows, checks, present) {
  const best = Math.min(...checks.map((check) => check.cost));
  const sentences = checks.length > 0 ? [ofTheCurve(rows, checks, present ?? best)] : [];
  const rises = rows.flatMap((row, index) => {
    const before = rows[index - 1];
    return before && row.cost > (1 + LEAST_RISE) * before.cost ? [ofARise(before, row, checks)] : [];
  });
  return [...sentences, ...rises.slice(-MOST_TOLD)];
}

/**
 * @param {readonly Pick<Progress, "cost">[]} rows
 * @param {readonly FineCheck[]} checks
 * @param {number} cost on the fine solid
 */
function ofTheCurve(rows, checks, cost) {
  const last = rows[rows.length - 1]?.cost;
  return (
    `The curve is of what the search works with, as a rule the coarse solid: ${significant(last, 4)} at last. ` +
    `What counts is the cost on the fine solid: ${significant(cost, 4)}, by ${checks.length} ` +
    `${checks.length === 1 ? "check" : "checks"}.`
  );
}

/**
 * @param {Pick<Progress, "seconds" | "cost">} before
 * @param {Pick<Progress, "seconds" | "cost">} row
 * @param {readonly FineCheck[]} checks
 */
function ofARise(before, row, checks) {
  const check = checks.find(({ seconds }) => seconds >= before.seconds && seconds <= row.seconds);
  const rise = `At ${withSeconds(row.seconds)} the cost rises from ${significant(before.cost)} to ${significant(row.cost)}:`;
  if (!check) return `${rise} a search began there, with its targets and settings as they were then.`;
  return (
    `${rise} a check found the fine solid ${fixed(check.fine_rms_cents, 1)} cents rms from the targets, the coarse one ` +
    `${fixed(check.coarse_rms_cents, 1)}. The search aims anew from there on, so costs before and after do not compare.`
  );
}
