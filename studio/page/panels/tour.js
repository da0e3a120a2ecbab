/** A tour of the page in five steps. It starts by itself where somebody is here for the first time. */

import { button, make, setText } from "./dom.js";

const SEEN = "carillon-studio-tour";

/** @type {{ place: string, title: string, text: string }[]} */
const STEPS = [
  {
    place: "#view",
    title: "I want to make sounds: open a solid",
    text:
      "If none is open, drop a mesh onto the page, choose one that comes along, or open an example. It is " +
      "prepared by itself. Drag beside it to turn it, and press anywhere on it to strike it, as hard as the " +
      "strength above it says.",
  },
  {
    place: "#panel-targets",
    title: "Say what a point shall sound like",
    text:
      "Strike a point, make it a target, and give it a recorded clip: a file, or what you record here. A " +
      "clip that is dropped onto the solid becomes a target where it fell.",
  },
  {
    place: "#panel-clip",
    title: "See what is in the clip",
    text:
      "The clip is taken apart into modes: frequency, damping, amplitude. Listen to the clip, its modes " +
      "alone and what they leave, and leave out modes that you do not want.",
  },
  {
    place: "#panel-project",
    title: "Let a material be sought",
    text:
      "Optimise looks for a stiffness that varies over the solid so that it sounds like the clips. Colours, " +
      "spectrum and errors follow while it runs. You may strike at any time, change targets, undo, go on.",
  },
  {
    place: "#panel-compare",
    title: "Compare, and take it along",
    text:
      "Hear clip and solid in turn, keep a material and swap it with another one. Save the project, or " +
      "export the design as a page, for synthesis or for other programs. The key ? lists all keys.",
  },
];

/**
 * Makes the tour.
 *
 * @param {HTMLElement} element
 * @param {import("../main.js").Parts} parts
 * @returns {{ open: () => void, close: () => void }}
 */
export function makeTour(element, parts) {
  let step = 0;
  /** @type {Element | null} */
  let focusedBefore = null;
  const title = make("h2", { id: "tour-title", tabindex: "-1" });
  const text = make("p", { id: "tour-text" });
  const count = make("p", { class: "tour-count" });
  const back = button("Back", () => go(step - 1));
  const next = button("Next", () => (step === STEPS.length - 1 ? close() : go(step + 1)), { class: "main" });
  const keys = button("Keys", () => {
    close();
    parts.shortcuts?.open();
  });
  const card = make(
    "div",
    {
      class: "tour-card",
      role: "dialog",
      "aria-labelledby": "tour-title",
      "aria-describedby": "tour-text",
      hidden: true,
    },
    make("div", { class: "tour-head" }, title, count),
    text,
    make(
      "div",
      { class: "row" },
      back,
      next,
      keys,
      button("End the tour", close, { class: "quiet" }),
    ),
  );
  element.append(card);

  // The page stays in reach, so that a step can be tried; hence no modal dialog, and Escape by hand,
  // before it means anything else.
  document.addEventListener(
    "keydown",
    (event) => {
      if (event.key !== "Escape" || card.hidden || document.querySelector("dialog[open]")) return;
      event.preventDefault();
      event.stopPropagation();
      close();
    },
    true,
  );

  function open() {
    if (card.hidden) focusedBefore = document.activeElement;
    remember();
    card.hidden = false;
    go(0);
  }

  function close() {
    if (card.hidden) return;
    card.hidden = true;
    point(null);
    if (focusedBefore instanceof HTMLElement) focusedBefore.focus();
    focusedBefore = null;
  }

  /** @param {number} number */
  function go(number) {
    const there = STEPS[number];
    if (!there) return;
    step = number;
    setText(title, there.title);
    setText(text, there.text);
    setText(count, `Step ${step + 1} of ${STEPS.length}`);
    back.disabled = step === 0;
    setText(next, step === STEPS.length - 1 ? "Done" : "Next");
    point(there.place);
    // Whoever cannot see the card hears the new step: its title takes the focus.
    title.focus({ preventScroll: true });
  }

  if (!wasSeen()) {
    const end = parts.state.onChange(() => {
      setTimeout(() => end());
      if (card.hidden && !wasSeen()) open();
    });
  }
  return { open, close };
}

/**
 * Frames the place that a step speaks of, and takes the frame from all others.
 *
 * @param {string | null} selector
 */
function point(selector) {
  for (const old of document.querySelectorAll(".tour-here")) old.classList.remove("tour-here");
  const place = selector === null ? null : document.querySelector(selector);
  place?.classList.add("tour-here");
  const isStill = matchMedia("(prefers-reduced-motion: reduce)").matches;
  place?.scrollIntoView({ block: "nearest", behavior: isStill ? "auto" : "smooth" });
}

/** Whether the tour was shown in this browser; where that cannot be kept it is not shown by itself. */
function wasSeen() {
  try {
    return localStorage.getItem(SEEN) !== null;
  } catch {
    return true;
  }
}

function remember() {
  try {
    localStorage.setItem(SEEN, "seen");
  } catch {
    // Storage is switched off: the tour is there by its button.
  }
}
