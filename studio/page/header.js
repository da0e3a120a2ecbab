/** The header: the project's name, undo and redo, save and open, help; whether the server is there. */

/** @typedef {import("./main.js").Parts} Parts */

/** @type {Record<import("./connection.js").Status, string>} */
const STATUS = {
  connecting: "Connecting",
  open: "",
  lost: "The server does not answer; strikes still sound.",
  refused: "The server was started anew: open the address that it printed.",
};

/**
 * @param {HTMLElement} element the header
 * @param {Parts} parts
 */
export function makeHeader(element, parts) {
  const { connection, state, keys } = parts;
  /** @param {string} id @returns {HTMLButtonElement} */
  const button = (id) => /** @type {HTMLButtonElement} */ (element.querySelector(`#${id}`));
  const [undo, redo, save, open, help] = ["undo", "redo", "save", "open", "help"].map(button);
  const name = /** @type {HTMLElement} */ (element.querySelector("#project-name"));
  const status = /** @type {HTMLElement} */ (element.querySelector("#connection-status"));

  /** @param {string} what @param {Record<string, unknown>} [values] */
  const ask = (what, values) =>
    connection.call(what, values).catch((error) => parts.say(error.message, "error"));

  const saveIt = async () => {
    const now = state.current;
    if (!now) return;
    if (!now.name) {
      document.querySelector("#panel-project")?.scrollIntoView({ block: "nearest" });
      /** @type {HTMLElement | null} */ (document.querySelector("#panel-project input[type=text]"))?.focus();
      parts.say("Give the project a name, then save it.");
      return;
    }
    await ask("save", { name: now.name });
  };

  undo.onclick = () => ask("undo");
  redo.onclick = () => ask("redo");
  save.onclick = saveIt;
  open.onclick = () => parts.view?.openChooser();
  help.onclick = () => (parts.tour ?? parts.shortcuts)?.open?.();
  keys.add("Control+z", "Undo", () => void ask("undo"));
  keys.add(["Control+Shift+z", "Control+y"], "Redo", () => void ask("redo"));
  keys.add("Control+s", "Save the project", () => void saveIt());
  keys.add("o", "Open a solid or a project", () => void parts.view?.openChooser());

  state.onChange((now) => {
    name.textContent = now.name ? `${now.name}${now.saved ? "" : " (not saved)"}` : "New project";
    document.title = `${now.name ? `${now.name} - ` : ""}Carillon studio`;
    for (const [made, what, verb] of /** @type {const} */ ([
      [undo, now.undo, "Undo"],
      [redo, now.redo, "Redo"],
    ])) {
      made.disabled = what === null;
      made.title = what === null ? `Nothing to ${verb.toLowerCase()}` : `${verb}: ${what}`;
      made.setAttribute("aria-label", what === null ? verb : `${verb}: ${what}`);
    }
    save.disabled = now.solid === null;
  });
  connection.onStatus((now) => (status.textContent = STATUS[now]));
}
