/** A question that is answered before anything is lost. */

import { identifier, make } from "./dom.js";

/**
 * Asks in a dialog; closing it in another way says no.
 *
 * @param {string} sentence
 * @param {string} yes text of the button that agrees
 * @param {string} no text of the other one, which has the focus
 * @returns {Promise<boolean>} whether somebody agreed
 */
export function agreed(sentence, yes, no) {
  const id = identifier("question");
  const dialog = make(
    "dialog",
    { class: "dialog question", "aria-labelledby": id },
    make(
      "form",
      { method: "dialog" },
      make("p", { id }, sentence),
      make(
        "div",
        { class: "buttons" },
        make("button", { value: "no", autofocus: true }, no),
        make("button", { value: "yes", class: "main" }, yes),
      ),
    ),
  );
  document.body.append(dialog);
  dialog.showModal();
  return new Promise((answer) => {
    dialog.addEventListener("close", () => {
      answer(dialog.returnValue === "yes");
      dialog.remove();
    });
  });
}
