/** Measured heads: the folder that they are read from, comparisons of pairs, and the preferred blend. */

import { ask } from "./chosen.js";
import { makeComparison } from "./comparison.js";
import { button, identifier, keepList, make, setText } from "./dom.js";
import { agreed } from "./question.js";

/** @typedef {import("../types.js").HeadsState} HeadsState */
/** @typedef {import("../types.js").State} State */

const LEAST_HEADS = 2;

/**
 * Makes the panel of heads, which is folded until it is used.
 *
 * @param {HTMLElement} element
 * @param {import("../main.js").Parts} parts
 */
export function makeHeads(element, parts) {
  const { state } = parts;
  const missing = make("p", { class: "hint", id: "heads-missing", role: "status" });
  const folder = make("select", { id: identifier("heads-folder"), onchange: show });
  const read = button("Read its heads", () => void open(folder.value, false), { class: "main" });
  const again = button("Look again", () => void ask(parts, "look_for_heads"));
  const folders = make(
    "div",
    { class: "pair" },
    make("label", { for: folder.id }, "Folder"),
    make("div", { class: "row" }, folder, read),
  );
  const says = make("p", { class: "hint", id: identifier("heads-says"), role: "status" });
  const bar = make("progress", { max: 1, "aria-labelledby": says.id });
  const comparison = makeComparison(parts);
  const blend = makeBlend(parts, comparison.play);
  const anew = button("Begin anew", () => void beginAnew(), { class: "quiet" });
  element.append(
    make(
      "details",
      { class: "more", ontoggle: look },
      make("summary", {}, "Find the measured head that you prefer"),
      make(
        "p",
        { class: "hint" },
        "With headphones: two blends of measured heads play the same sound, and you say by which one it comes " +
          "from where it should. Scenes are then heard by the blend that you prefer.",
      ),
      missing,
      again,
      folders,
      says,
      bar,
      comparison.element,
      blend.element,
      make("div", { class: "row" }, anew),
    ),
  );

  /** @param {Event} event */
  function look(event) {
    if (/** @type {HTMLDetailsElement} */ (event.target).open) void ask(parts, "look_for_heads");
  }

  /** @param {string} name @param {boolean} isAnew */
  async function open(name, isAnew) {
    await ask(parts, "open_heads", isAnew ? { folder: name, anew: true } : { folder: name });
    if (state.current?.heads.phase === "ready") comparison.focus();
  }

  async function beginAnew() {
    const heads = state.current?.heads;
    if (!heads?.folder) return;
    const question = `Begin anew with ${heads.folder}? The answers so far are kept as ${heads.file}~.`;
    if (await agreed(question, "Begin anew", "Go on")) await open(heads.folder, true);
  }

  function show() {
    const now = state.current;
    if (!now) return;
    const { heads } = now;
    showFolders(now);
    setText(says, saying(heads));
    says.hidden = says.textContent === "";
    says.classList.toggle("field-error", heads.phase === "failed");
    bar.hidden = heads.phase !== "reading";
    if (heads.progress === null) bar.removeAttribute("value");
    else bar.value = heads.progress;
    comparison.show(now);
    blend.show(heads);
    anew.hidden = !(heads.phase === "failed" || (heads.phase === "ready" && heads.comparisons > 0));
  }

  /** @param {State} now */
  function showFolders({ heads, workspace }) {
    const usable = heads.folders.filter((each) => each.heads >= LEAST_HEADS);
    const before = folder.value || heads.folder;
    keepList(
      folder,
      usable,
      (each) => each.name,
      (each) => make("option", { value: each.name }),
      (option, each) => setText(option, `${each.name}, ${each.heads} heads`),
    );
    if (usable.some((each) => each.name === before)) folder.value = before ?? "";
    folders.hidden = usable.length === 0;
    again.hidden = !folders.hidden;
    read.disabled = heads.phase === "reading" || (heads.phase === "ready" && heads.folder === folder.value);
    const isMissing = usable.length === 0 && heads.phase === "none";
    setText(
      missing,
      isMissing
        ? `The workspace ${workspace} has no folder of two or more measured heads (.sofa): copy one there, of a ` +
            "database that sofaconventions.org lists, and look again."
        : "",
    );
    missing.hidden = !isMissing;
  }

  state.onChange(show);
}

/**
 * What is told of the heads that are read.
 *
 * @param {HeadsState} heads
 * @returns {string}
 */
function saying(heads) {
  if (heads.phase === "reading") return `${heads.folder}: ${heads.message ?? "its heads are being read"} \u2026`;
  if (heads.phase === "failed") return heads.message ?? "";
  if (heads.phase === "ready") return `${heads.heads} heads of ${heads.folder}; answers are kept in ${heads.file}.`;
  return heads.folder ? `Last time the heads were those of ${heads.folder}; read them to go on.` : "";
}

/**
 * Makes what plays and writes the blend that is preferred so far.
 *
 * @param {import("../main.js").Parts} parts
 * @param {(part: "before" | "after") => void} play
 * @returns {{ element: HTMLElement, show: (heads: HeadsState) => void }}
 */
function makeBlend(parts, play) {
  const write = button("Write the blend (SOFA)", () => void writeIt());
  const written = make("p", { class: "hint", role: "status" });
  const element = make(
    "div",
    {},
    make("h3", {}, "The blend that you prefer so far"),
    make(
      "div",
      { class: "row", role: "group", "aria-label": "Before and after" },
      button("Before: the first head", () => play("before")),
      button("After: your blend", () => play("after")),
    ),
    make("div", { class: "row" }, write),
    written,
  );

  async function writeIt() {
    write.disabled = true;
    await ask(parts, "write_blend");
    write.disabled = false;
    write.focus();
  }

  return {
    element,
    show(heads) {
      element.hidden = heads.phase !== "ready";
      const { blend } = heads;
      written.hidden = blend === null;
      if (blend) {
        const key = make("code", {}, `listener: {hrtf: ${blend.file}}`);
        const count = `${blend.comparisons} ${blend.comparisons === 1 ? "comparison" : "comparisons"}`;
        written.replaceChildren(`${blend.file} is that after ${count}. A scene is heard by it with `, key, ".");
      }
    },
  };
}
