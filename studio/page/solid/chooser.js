/** What can be opened: a mesh file, a built-in solid, an example, a project of the workspace. */

import { UNITS, openMesh } from "./files.js";

/** @typedef {import("../main.js").Parts} Parts */

/**
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag
 * @param {Partial<HTMLElementTagNameMap[K]>} [values]
 * @param {...(Node | string)} children
 * @returns {HTMLElementTagNameMap[K]}
 */
function element(tag, values = {}, ...children) {
  const made = Object.assign(document.createElement(tag), values);
  made.append(...children);
  return made;
}

/**
 * @param {string} title
 * @param {{name: string, says?: string, open: () => void}[]} entries
 * @returns {HTMLElement}
 */
function choices(title, entries) {
  const list = element("ul", { className: "choices" });
  for (const { name, says, open } of entries) {
    const button = element("button", { type: "button", onclick: open }, name);
    list.append(element("li", {}, button, ...(says ? [element("span", {}, says)] : [])));
  }
  return element("div", { className: described(entries) }, element("h3", {}, title), list);
}

/** @returns {HTMLSelectElement} units of length, whose values are metres */
function unitSelect() {
  return element(
    "select",
    { name: "unit" },
    ...UNITS.map(([metres, name]) => element("option", { value: String(metres) }, name)),
  );
}

/** @param {{says?: string}[]} entries @returns {string} */
const described = (entries) => (entries.some((entry) => entry.says) ? "told" : "untold");

/**
 * Fills an element with all that can be opened now.
 *
 * @param {HTMLElement} place
 * @param {Parts} parts
 * @param {() => void} chosen called as soon as something is
 */
export function fillChooser(place, parts, chosen) {
  const now = parts.state.current;
  if (!now) return;
  /** @param {string} what @param {Record<string, unknown>} values @returns {() => void} */
  const call = (what, values) => () => {
    chosen();
    parts.connection.call(what, values).catch((error) => parts.say(error.message, "error"));
  };
  const unit = unitSelect();
  const file = element("input", { type: "file", name: "mesh", accept: ".obj,.stl,.ply,.off,.glb,.gltf" });
  file.onchange = () => {
    const taken = file.files?.[0];
    if (!taken) return;
    chosen();
    openMesh(parts, taken, Number(unit.value));
  };
  place.replaceChildren(
    ...(now.examples.length > 0
      ? [
          choices(
            "An example, ready to play with",
            now.examples.map(({ project, name, says }) => ({ name, says, open: call("open_project", { project }) })),
          ),
        ]
      : []),
    choices(
      "A built-in solid",
      now.builtins.map((name) => ({ name, open: call("open_mesh", { mesh: `builtin:${name}`, unit: 1 }) })),
    ),
    element(
      "div",
      { className: "chooser-file" },
      element("h3", {}, "A mesh file"),
      element("label", {}, "One unit of the file is ", unit),
      element("label", {}, element("span", { className: "hidden" }, "Mesh file"), file),
      element("p", { className: "quiet" }, "Or drop one anywhere on the page. An open surface is filled, unless it gets a wall."),
    ),
    ...(now.projects.length > 0
      ? [
          choices(
            "A project of the workspace",
            now.projects.map(({ project, name }) => ({ name, open: call("open_project", { project }) })),
          ),
        ]
      : []),
  );
}

/**
 * A dialog of all that can be opened.
 *
 * @param {HTMLElement} place where it is put
 * @param {Parts} parts
 * @returns {() => void} what opens it
 */
export function makeChooser(place, parts) {
  const content = element("div", { className: "chooser" });
  const close = element("button", { type: "button" }, "Cancel");
  const title = element("h2", { id: "chooser-title" }, "Open");
  const buttons = element("div", { className: "buttons" }, close);
  const dialog = element("dialog", { className: "dialog" }, title, content, buttons);
  dialog.setAttribute("aria-labelledby", "chooser-title");
  close.onclick = () => dialog.close();
  place.append(dialog);
  return () => {
    if (dialog.open) return;
    fillChooser(content, parts, () => dialog.close());
    dialog.showModal();
  };
}

/**
 * A dialog that asks for the unit of a mesh that was dropped, which most files do not tell.
 *
 * @param {HTMLElement} place where it is put
 * @param {Parts} parts
 * @returns {(file: File) => void} what opens it
 */
export function makeUnitDialog(place, parts) {
  const title = element("h2", { id: "unit-title" });
  const unit = unitSelect();
  const open = element("button", { type: "submit", className: "main" }, "Open");
  const cancel = element("button", { type: "button" }, "Cancel");
  const form = element(
    "form",
    { method: "dialog" },
    element("label", {}, "One unit of the file is ", unit),
    element("div", { className: "buttons" }, open, cancel),
  );
  const dialog = element("dialog", { className: "dialog" }, title, form);
  dialog.setAttribute("aria-labelledby", "unit-title");
  place.append(dialog);
  /** @type {File | null} */
  let dropped = null;
  cancel.onclick = () => dialog.close();
  form.onsubmit = () => {
    if (dropped) openMesh(parts, dropped, Number(unit.value));
  };
  return (file) => {
    if (/\.(glb|gltf)$/i.test(file.name)) {
      openMesh(parts, file, 1); // in metres, as its standard demands
      return;
    }
    dropped = file;
    title.textContent = `Open ${file.name}`;
    if (!dialog.open) dialog.showModal();
  };
}
