/** One comparison of two heads: both play the same sound, and one of five answers is given. */

import { ask, attempt } from "./chosen.js";
import { directionWords, makeDirection } from "./direction.js";
import { button, identifier, make, setText } from "./dom.js";

/** @typedef {import("../types.js").State} State */
/** @typedef {"A" | "B" | "before" | "after"} Part */

/** Answers by their scores, from 1. */
const ANSWERS = ["A much better", "A better", "the same", "B better", "B much better"];

/**
 * Makes a comparison; `play` sounds its pair, or the first head and the preferred blend, from its direction.
 *
 * @param {import("../main.js").Parts} parts
 * @returns {{ element: HTMLElement, show: (now: State) => void, focus: () => void, play: (part: Part) => void }}
 */
export function makeComparison(parts) {
  let number = -1;
  const direction = makeDirection();
  const from = make("p", { class: "figure-line", id: identifier("comparison") });
  const strike = make("option", { value: "strike" }, "strike of the solid");
  const stimulus = make(
    "select",
    { id: identifier("stimulus") },
    make("option", { value: "noise" }, "bursts of noise"),
    strike,
  );
  const radios = ANSWERS.map((_, index) =>
    make("input", { type: "radio", name: from.id, value: index + 1, onchange: showNext, "aria-keyshortcuts": index + 1 }),
  );
  const next = make("button", { class: "main" }, "Next");
  const answers = make(
    "form",
    { onsubmit: answer },
    make(
      "fieldset",
      { class: "plain" },
      make("legend", { class: "hidden" }, "Which one comes from there more clearly?"),
      make("div", { class: "scale" }, ...radios.map((radio, index) => make("label", {}, radio, ANSWERS[index]))),
    ),
    make("div", { class: "row" }, next),
  );
  const count = make("p", { class: "hint", role: "status" });
  const element = make(
    "div",
    { class: "comparison", role: "group", "aria-labelledby": from.id, tabindex: -1, onkeydown: hear },
    from,
    direction.element,
    make("div", { class: "pair" }, make("label", { for: stimulus.id }, "Sound"), stimulus),
    make(
      "div",
      { class: "row", role: "group", "aria-label": "Listen to the pair" },
      button("A", () => void play("A"), { class: "letter", "aria-keyshortcuts": "a", title: "Key A" }),
      button("B", () => void play("B"), { class: "letter", "aria-keyshortcuts": "b", title: "Key B" }),
    ),
    answers,
    make("p", { class: "hint" }, "Keys while the focus is here: A, B, 1 to 5, Enter."),
    count,
  );

  /** @param {Part} part */
  async function play(part) {
    const path = `/heads/${number}/${part}?stimulus=${stimulus.value}`;
    await attempt(parts, () => parts.player.play(path));
  }

  const chosen = () => radios.find((radio) => radio.checked) ?? null;

  /** @param {KeyboardEvent} event */
  function hear(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.isComposing) return;
    if (event.target instanceof HTMLSelectElement) return;
    const key = event.key.toUpperCase();
    const radio = radios.find((each) => each.value === key);
    if (key === "A" || key === "B") void play(key);
    else if (radio) choose(radio);
    else if (event.key === "Enter" && event.target === element) void answer(event);
    else return;
    event.preventDefault();
  }

  /** @param {HTMLInputElement} radio */
  function choose(radio) {
    radio.checked = true;
    radio.focus();
    showNext();
  }

  /** @param {Event} event */
  async function answer(event) {
    event.preventDefault();
    const score = Number(chosen()?.value ?? 0);
    if (score === 0 || next.disabled) return;
    // What has the focus is about to be disabled or cleared.
    element.focus();
    next.disabled = true;
    parts.player.stop();
    await ask(parts, "compare_heads", { number, score });
    showNext();
  }

  function showNext() {
    next.disabled = chosen() === null;
  }

  // The comparison takes these itself when the focus is in it; they are here for the list.
  const elsewhere = () => false;
  parts.keys.add(["a", "b"], "In a comparison of heads: play A or B", elsewhere);
  parts.keys.add(["1", "2", "3", "4", "5"], "In a comparison of heads: A much better to B much better", elsewhere);
  parts.keys.add("Enter", "In a comparison of heads: take the answer, on to the next", elsewhere);

  return {
    element,
    focus: () => element.focus(),
    play: (part) => void play(part),
    show({ heads, solid }) {
      element.hidden = heads.phase !== "ready";
      if (heads.phase !== "ready") {
        number = -1;
        return;
      }
      strike.disabled = solid?.phase !== "ready";
      if (strike.disabled) stimulus.value = "noise";
      if (number === heads.comparisons) return;
      number = heads.comparisons;
      for (const radio of radios) radio.checked = false;
      showNext();
      direction.show(heads.direction);
      setText(from, `Meant to come from ${directionWords(heads.direction)}`);
      const told = number === 1 ? "1 comparison" : `${number} comparisons`;
      setText(
        count,
        `${told} so far. Stop whenever you like, and go on another day: the blend follows your answers from the ` +
          "fourth on, and 120 are about as many as it can use.",
      );
    },
  };
}
