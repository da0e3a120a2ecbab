/** How far every mode is from what is wanted, in a table. */

import { chosenPoint, chosenTarget, strikeTarget } from "./chosen.js";
import { button, find, keepList, make, setAttribute, setText } from "./dom.js";
import { fixed, rootMeanSquare } from "./numbers.js";
import { levelDifference, pairsOf } from "./pairs.js";

/** @typedef {import("./pairs.js").Pair} Pair */

/** Hardly anybody hears less. */
const HEARD_CENTS = 5;
const MOST_MARKED = 3;

/**
 * Makes the table of errors.
 *
 * @param {HTMLElement} element
 * @param {import("../main.js").Parts} parts
 */
export function makeErrors(element, parts) {
  const { connection, state, selection } = parts;
  /** @type {[any, any] | null} */
  let bank = null;
  /** @type {number | null} the mode that sounds alone */
  let alone = null;

  const none = make("p", { class: "hint" }, "A target with a clip shows here how far each mode is from it.");
  const total = make("p", { class: "figure-line" });
  const level = make("th", { scope: "col", class: "number" });
  const rows = make("tbody");
  const all = button("All modes again", () => soundAlone(null), { hidden: true });
  const table = make(
    "table",
    { class: "figures" },
    make("caption", { class: "hidden" }, "Modes of the solid and what is wanted of them"),
    make(
      "thead",
      {},
      make(
        "tr",
        {},
        make("th", { scope: "col" }, "Mode"),
        heading("Wanted", "Hz"),
        heading("Now", "Hz"),
        heading("Off", "cents"),
        heading("Off", "bark"),
        level,
        make("th", { scope: "col" }, make("span", { class: "hidden" }, "Hear it alone")),
      ),
    ),
    rows,
  );
  const body = make(
    "div",
    { hidden: true },
    total,
    make("div", { class: "row" }, all),
    make("div", { class: "scroll", tabindex: 0, role: "group", "aria-label": "Table of errors" }, table),
    make("p", { class: "hint" }, "\u25b2 marks those that are farthest off."),
  );
  level.append("Level", make("br"), make("small", {}, "dB"));
  element.append(none, body);

  /** @param {number | null} mode */
  function soundAlone(mode) {
    alone = mode;
    parts.bank.solo(mode === null ? null : [mode]);
    if (mode !== null) strikeTarget(parts, chosenTarget(parts));
    show();
  }

  /** @param {Pair} pair */
  function create(pair) {
    const { mode } = pair;
    const figures = ["wanted", "now", "cents", "bark", "loudness"].map((name) =>
      make("td", { class: `number ${name}` }),
    );
    return make(
      "tr",
      { onpointerenter: () => selection.set({ mode }), onpointerleave: () => selection.set({ mode: null }) },
      make("th", { scope: "row" }, String(mode + 1), make("span", { class: "worst" })),
      ...figures,
      make(
        "td",
        {},
        button("\u25b6\ufe0e", () => soundAlone(alone === mode ? null : mode), {
          class: "small",
          onfocus: () => selection.set({ mode }),
          "aria-label": `Mode ${mode + 1} alone`,
        }),
      ),
    );
  }

  function show() {
    const target = chosenTarget(parts);
    const pairs = bank ? pairsOf(bank[0], bank[1], state.current, chosenPoint(parts)) : [];
    const wanted = pairs.filter((pair) => pair.wantedHertz !== null);
    none.hidden = wanted.length > 0;
    body.hidden = wanted.length === 0;
    if (wanted.length === 0) {
      // The table's buttons are gone: nobody could let the others be heard again.
      if (alone !== null) soundAlone(null);
      return;
    }
    const worst = worstOf(wanted);
    keepList(rows, wanted, (pair) => String(pair.mode), create, (row, pair) => update(row, pair, worst));
    const rms = bank?.[0].rms_cents ?? rootMeanSquare(wanted.map((pair) => pair.cents ?? 0));
    setText(total, `${fixed(rms, 1)} cents rms over ${wanted.length} modes${bank?.[0].fine ? ", on the fine solid" : ""}`);
    setAttribute(level, "title", target ? `Louder than wanted at ${target.name}` : null);
    all.hidden = alone === null;
  }

  /**
   * @param {HTMLElement} row
   * @param {Pair} pair
   * @param {Set<number>} worst
   */
  function update(row, pair, worst) {
    /** @type {[string, string][]} */
    const texts = [
      [".wanted", fixed(pair.wantedHertz, 1)],
      [".now", fixed(pair.hertz, 1)],
      [".cents", fixed(pair.cents, 1, true)],
      [".bark", fixed(pair.bark, 2, true)],
      [".loudness", fixed(levelDifference(pair), 1, true)],
    ];
    for (const [selector, text] of texts) setText(find(row, selector, HTMLElement), text);
    const isWorst = worst.has(pair.mode);
    row.classList.toggle("far", isWorst);
    row.classList.toggle("pointed", selection.current.mode === pair.mode);
    const mark = find(row, ".worst", HTMLElement);
    setText(mark, isWorst ? " \u25b2" : "");
    setAttribute(mark, "role", isWorst ? "img" : null);
    setAttribute(mark, "aria-label", isWorst ? "among the farthest off" : null);
    setAttribute(find(row, "button", HTMLButtonElement), "aria-pressed", alone === pair.mode ? "true" : "false");
  }

  connection.onBinary("bank", (header, arrays) => {
    bank = [header, arrays];
    if (alone !== null && alone >= arrays.hertz.length) soundAlone(null);
    show();
  });
  state.onChange((now, before) => {
    if (!now.solid) bank = null;
    if (!before || now.wanted !== before.wanted || now.targets !== before.targets) show();
  });
  selection.onChange((now, before) => {
    if (now.target !== before.target) show();
    if (now.mode === before.mode) return;
    for (const row of rows.children) {
      if (row instanceof HTMLElement) row.classList.toggle("pointed", row.dataset.key === String(now.mode));
    }
  });
}

/**
 * Numbers of the modes that are farthest off, of those that are heard to be.
 *
 * @param {Pair[]} pairs
 */
function worstOf(pairs) {
  const size = (/** @type {Pair} */ pair) => Math.abs(pair.cents ?? 0);
  const heard = pairs.filter((pair) => size(pair) > HEARD_CENTS);
  heard.sort((one, other) => size(other) - size(one));
  return new Set(heard.slice(0, MOST_MARKED).map((pair) => pair.mode));
}

/**
 * @param {string} text
 * @param {string} unit
 */
function heading(text, unit) {
  return make("th", { scope: "col", class: "number" }, text, make("br"), make("small", {}, unit));
}
