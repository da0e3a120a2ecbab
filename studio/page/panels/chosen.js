/** The selected target, its clip, and what is asked of the server and of the sound for it. */

import { agreed } from "./question.js";

/** @typedef {import("../main.js").Parts} Parts */
/** @typedef {import("../types.js").State} State */
/** @typedef {import("../types.js").Target} Target */
/** @typedef {import("../types.js").Clip} Clip */
/** @typedef {"sound" | "modes" | "rest" | "noise"} ClipPart */

/**
 * The target that is selected.
 *
 * @param {Parts} parts
 * @returns {Target | null}
 */
export function chosenTarget(parts) {
  const name = parts.selection.current.target;
  return parts.state.current?.targets.find((target) => target.name === name) ?? null;
}

/**
 * The point whose spectrum is looked at: the selected target, or else the point struck last.
 *
 * @param {Parts} parts
 * @returns {{ name: string | null, vertex: number }}
 */
export function chosenPoint(parts) {
  const target = chosenTarget(parts);
  if (target) return target;
  return { name: null, vertex: parts.selection.current.vertex ?? 0 };
}

/**
 * The clip of a target.
 *
 * @param {State | null} state
 * @param {Target | null} target
 * @returns {Clip | null}
 */
export function clipOf(state, target) {
  if (!state || !target || target.clip === null) return null;
  return state.clips.find((clip) => clip.clip === target.clip) ?? null;
}

/**
 * Asks the server; what it refuses is told to the person.
 *
 * @param {Parts} parts
 * @param {string} name of the call
 * @param {Record<string, unknown>} [values]
 * @returns {Promise<boolean>} whether it was done
 */
export async function ask(parts, name, values) {
  return attempt(parts, () => parts.connection.call(name, values));
}

/**
 * Does something; what goes wrong is told to the person.
 *
 * @param {Parts} parts
 * @param {() => unknown} doIt
 * @returns {Promise<boolean>} whether it was done
 */
export async function attempt(parts, doIt) {
  try {
    await doIt();
    return true;
  } catch (error) {
    parts.say(error instanceof Error ? error.message : String(error), "error");
    return false;
  }
}

/**
 * Sounds a part of a target's clip.
 *
 * @param {Parts} parts
 * @param {Target | null} target
 * @param {ClipPart} part
 * @returns {Promise<boolean>} when it is over; whether it could be played
 */
export async function playClip(parts, target, part) {
  if (!target || target.clip === null) {
    parts.say(target ? `${target.name} has no clip yet: choose a file or record one.` : "Select a target first.");
    return false;
  }
  return attempt(parts, () => parts.player.play(clipPath(target, part)));
}

/**
 * Address of a part of a target's clip.
 *
 * @param {Target} target
 * @param {ClipPart} part
 */
export function clipPath(target, part) {
  return `/clip/${encodeURIComponent(target.clip ?? "")}/${part}`;
}

/**
 * Strikes the solid at a target.
 *
 * @param {Parts} parts
 * @param {Target | null} target
 */
export function strikeTarget(parts, target) {
  if (!target) {
    parts.say("Select a target first.");
    return;
  }
  if (parts.bank.failure !== null) {
    parts.say(parts.bank.failure, "error");
    return;
  }
  parts.bank.strike(target.vertex, parts.selection.current.strength);
}

/**
 * Whether a target may get another clip: one that it has already is replaced only if somebody agrees.
 *
 * @param {Parts} parts
 * @param {string} target its name
 * @param {string} name of the other clip
 * @returns {Promise<boolean>}
 */
export async function mayReplaceClip(parts, target, name) {
  const now = parts.state.current;
  const present = clipOf(now, now?.targets.find((one) => one.name === target) ?? null);
  if (!present) return true;
  return agreed(
    `${target} has the clip ${present.name}. Replace it by ${name}?`,
    `Replace by ${name}`,
    `Keep ${present.name}`,
  );
}

/**
 * Sends a sound to the server and makes it a target's clip; asks before that replaces another one.
 *
 * @param {Parts} parts
 * @param {string} target its name
 * @param {string} name of the file
 * @param {Blob} sound
 */
export async function giveClip(parts, target, name, sound) {
  return attempt(parts, async () => {
    const clip = await parts.connection.upload("clip", name, sound);
    if (!(await mayReplaceClip(parts, target, name))) return; // it stays in the list of clips
    await parts.connection.call("change_target", { target, clip });
  });
}
