/** Comparing by ear: the clip with the solid, the present material with a kept one. */

import { ask, attempt, chosenTarget, clipOf, clipPath, playClip, strikeTarget } from "./chosen.js";
import { button, make, setText } from "./dom.js";

const LONGEST_WAIT_MS = 5000;
/** Until the player is free again. */
const STRIKE_SECONDS = 0.5;

/**
 * Makes the panel of comparisons.
 *
 * @param {HTMLElement} element
 * @param {import("../main.js").Parts} parts
 */
export function makeCompare(element, parts) {
  const { connection, state, selection, keys } = parts;
  const now = () => chosenTarget(parts);

  const where = make("p", { class: "hint" });
  const clip = button("Clip", () => void playClip(parts, now(), "sound"), withKey("c"));
  const solid = button("Solid", () => strikeTarget(parts, now()), withKey("Enter"));
  const turn = button("Clip, then solid", () => void inTurn(), { ...withKey("b"), class: "main" });
  const keep = button("Keep this one as A", () => void keepIt(), withKey("k"));
  const swap = button("Swap", () => void swapIt(), withKey("x"));
  const kept = make("p", { class: "hint", role: "status" });
  element.append(
    make("h3", {}, "Clip and solid"),
    where,
    make("div", { class: "row", role: "group", "aria-label": "Clip and solid" }, turn, clip, solid),
    make("h3", {}, "Two materials"),
    make("div", { class: "row", role: "group", "aria-label": "Two materials" }, keep, swap),
    kept,
  );

  async function inTurn() {
    const target = now();
    if (!target || clipOf(state.current, target) === null) {
      await playClip(parts, target, "sound");
      return;
    }
    const strike = () => {
      strikeTarget(parts, target);
      return STRIKE_SECONDS;
    };
    await attempt(parts, () => parts.player.playInTurn([clipPath(target, "sound"), strike]));
  }

  async function keepIt() {
    if (state.current?.solid) await ask(parts, "keep");
  }

  async function swapIt() {
    if (!state.current?.heard) {
      parts.say("There is no other material: keep this one, change it, then swap.");
      return;
    }
    const heard = nextBank();
    // Swapped materials are heard at once, where there is a target to strike.
    if ((await ask(parts, "swap")) && (await heard) && now()) strikeTarget(parts, now());
  }

  /** @returns {Promise<boolean>} whether another bank came soon */
  function nextBank() {
    return new Promise((resolve) => {
      const end = connection.onBinary("bank", () => finish(true));
      const timer = setTimeout(() => finish(false), LONGEST_WAIT_MS);
      /** @param {boolean} isThere */
      function finish(isThere) {
        clearTimeout(timer);
        end();
        // The bank's own part is told of it, too, before it is struck.
        setTimeout(() => resolve(isThere));
      }
    });
  }

  function show() {
    const target = now();
    const hasClip = clipOf(state.current, target) !== null;
    const hasSolid = (state.current?.solid?.surface ?? null) !== null;
    setText(where, target ? `At ${target.name}, which is selected.` : "Select a target first.");
    clip.disabled = !hasClip;
    solid.disabled = !target || !hasSolid;
    turn.disabled = clip.disabled || solid.disabled;
    keep.disabled = !hasSolid;
    const heard = state.current?.heard ?? null;
    swap.disabled = heard === null;
    const other = heard === "A" ? "B" : "A";
    setText(kept, heard ? `You hear ${heard}; swap to hear ${other}.` : "None is kept yet.");
  }

  keys.add("c", "Play the selected target's clip", () => void playClip(parts, now(), "sound"));
  keys.add("b", "Both: the clip, then the solid", () => void inTurn());
  keys.add("k", "Keep this material as A, go on with B", () => void keepIt());
  keys.add("x", "Swap with the kept material", () => void swapIt());
  state.onChange(show);
  selection.onChange(show);
}

/** @param {string} key */
function withKey(key) {
  return { "aria-keyshortcuts": key, title: `Key ${key.length === 1 ? key.toUpperCase() : key}` };
}
