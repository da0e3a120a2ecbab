/** The list of keys. */

import { make, sheetHead } from "./dom.js";

/** @typedef {import("../keys.js").Key} Key */

/** @type {Record<string, string>} */
const SIGNS = {
  " ": "Space",
  ArrowLeft: "\u2190",
  ArrowRight: "\u2192",
  ArrowUp: "\u2191",
  ArrowDown: "\u2193",
  Control: "Ctrl",
  Escape: "Esc",
};

/**
 * Makes the dialog that lists all keys.
 *
 * @param {HTMLElement} element
 * @param {import("../main.js").Parts} parts
 * @returns {{ open: () => void }}
 */
export function makeShortcuts(element, parts) {
  const body = make("tbody");
  const dialog = make(
    "dialog",
    { class: "sheet", "aria-labelledby": "shortcuts-title" },
    sheetHead("shortcuts-title", "Keys"),
    make("p", { class: "hint" }, "They hold wherever nobody is typing into a field."),
    make(
      "table",
      { class: "keys" },
      make("thead", {}, make("tr", {}, make("th", { scope: "col" }, "Key"), make("th", { scope: "col" }, "Does"))),
      body,
    ),
  );
  element.append(dialog);

  function open() {
    if (dialog.open) return;
    body.replaceChildren(...parts.keys.list.map(row));
    dialog.showModal();
  }

  parts.keys.add("?", "List all keys", open);
  return { open };
}

/** @param {Key} key */
function row(key) {
  const digits = key.keys.filter((name) => /^\d$/.test(name));
  const isRun = digits.length > 2 && digits.length === key.keys.length;
  const [first = "", last = ""] = [digits[0], digits[digits.length - 1]];
  const names = isRun
    ? [...written(first), " to ", ...written(last)]
    : key.keys.flatMap((name, index) => [index > 0 && " or ", ...written(name)]);
  return make("tr", {}, make("td", {}, ...names), make("td", {}, key.says));
}

/**
 * A key as it stands on keyboards.
 *
 * @param {string} name
 * @returns {(Node | string)[]}
 */
function written(name) {
  const [last = "", ...held] = name === "+" ? ["+"] : name.split("+").reverse();
  const shown = [...held.reverse(), last.length === 1 ? last.toUpperCase() : last];
  return shown.flatMap((part, index) => [
    ...(index > 0 ? ["+"] : []),
    make("kbd", {}, SIGNS[part] ?? part),
  ]);
}
