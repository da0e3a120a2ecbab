/** Sentences for the person: the latest ones for a while, all of the last ones on demand. */

import { button, make, setText, sheetHead } from "./dom.js";

/** @typedef {"note" | "error"} Kind */

const NOTE_SECONDS = 8;
const MOST_SHOWN = 3;
const MOST_KEPT = 50;

/**
 * Makes the messages.
 *
 * @param {HTMLElement} element a live region
 * @param {import("../main.js").Parts} parts
 */
export function makeMessages(element, parts) {
  const list = make("ol", { class: "message-list", reversed: true });
  const dialog = make(
    "dialog",
    { class: "sheet", "aria-labelledby": "messages-title" },
    sheetHead("messages-title", "Messages"),
    list,
  );
  const count = button("", () => dialog.showModal(), { class: "message-count", hidden: true });
  const shown = make("div", { class: "message-stack" });
  // Only what is new is read out: neither how many there are nor the list.
  element.append(shown);
  element.after(dialog);
  document.getElementById("side")?.append(count);

  parts.connection.onEvent("said", (event) => tell(event.text, event.kind === "error" ? "error" : "note"));

  // What was said of another solid is in the list.
  parts.state.onChange((now, before) => {
    if (before && (now.name !== before.name || now.solid?.mesh !== before.solid?.mesh)) shown.replaceChildren();
  });

  /**
   * @param {string} text
   * @param {Kind} kind
   */
  function tell(text, kind) {
    const time = new Date().toLocaleTimeString([], { hour: "2-digit", minute: "2-digit", second: "2-digit" });
    const prefix = kind === "error" ? "Error: " : "";
    list.prepend(make("li", { class: `message-${kind}` }, make("time", {}, time), ` ${prefix}${text}`));
    while (list.children.length > MOST_KEPT) list.lastElementChild?.remove();
    count.hidden = false;
    setText(count, list.children.length === 1 ? "1 message" : `${list.children.length} messages`);
    show(text, kind);
  }

  /**
   * @param {string} text
   * @param {Kind} kind
   */
  function show(text, kind) {
    const same = Array.from(shown.children).find((child) => child.querySelector("span")?.textContent === text);
    same?.remove();
    const message = make("div", { class: `message ${kind}` });
    const close = button("\u00d7", () => message.remove(), { class: "message-close", "aria-label": "Dismiss" });
    message.append(
      kind === "error" ? make("strong", {}, "Error: ") : "",
      make("span", {}, text),
      close,
    );
    shown.append(message);
    while (shown.children.length > MOST_SHOWN) shown.firstElementChild?.remove();
    // Errors stay until they are dismissed or another solid is opened, notes while somebody looks at them.
    if (kind === "note") fade(message);
  }

  /** @param {HTMLElement} message */
  function fade(message) {
    setTimeout(() => {
      if (message.matches(":hover, :focus-within")) fade(message);
      else message.remove();
    }, NOTE_SECONDS * 1000);
  }
}
