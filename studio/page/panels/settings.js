/** The project's settings: a form made from the schema of projects, which sends what was changed. */

import { button, make, setText } from "./dom.js";
import { isShown, makeField } from "./fields.js";
import { optionOf } from "./materials.js";
import { FieldError } from "./values.js";

/** @typedef {import("./fields.js").Field} Field */
/** @typedef {import("./values.js").Schema} Schema */

/** @type {[string, "young" | "density" | "poisson"][]} settings that a material by name has, and its constants */
const CONSTANTS = [
  ["material.young", "young"],
  ["density", "density"],
  ["poisson", "poisson"],
];
const IMPORTANT = [
  "resolution",
  "coarsen",
  "modes",
  "optimiser.seconds",
  "density",
  "material.young",
  "weights.frequency",
  "weights.amplitude",
  "weights.regulariser",
];
/** What regions tell instead, where there are any. */
const TOLD_BY_REGIONS = ["density", "poisson", "material.young"];
/** What the page sets elsewhere. */
const ELSEWHERE = ["mesh", "unit", "up", "wall", "targets", "regions", "supports"];

/** @type {Record<string, string>} */
const SECTIONS = {
  "": "Solid",
  material: "Material",
  damping: "Damping",
  weights: "Weights",
  optimiser: "Search",
};

/**
 * Makes the form of settings.
 *
 * @param {HTMLElement} element
 * @param {import("../main.js").Parts} parts
 */
export function makeSettings(element, parts) {
  const { connection, state, materials } = parts;
  /** @type {Field[]} */
  let fields = [];
  /** Paths of fields that somebody typed into since they were last applied. */
  const edited = new Set();

  const said = make("p", { class: "form-said", role: "status" });
  const apply = make("button", { type: "submit", class: "main" }, "Apply");
  const discard = button("Discard", () => {
    edited.clear();
    fields.forEach((field) => field.complain(""));
    show();
    tell("");
  });
  const body = make("div", { class: "form-body" }, make("p", { class: "hint" }, "Settings are on their way …"));
  const form = make(
    "form",
    { class: "settings-form", novalidate: true, onsubmit: send },
    body,
    make("div", { class: "form-actions" }, apply, discard, said),
  );
  element.append(form);

  const preset = make("select", { id: "material-preset", onchange: takePreset });
  const presetRow = make(
    "div",
    { class: "field" },
    make("label", { class: "field-label", for: "material-preset" }, "Material at the start"),
    make("div", { class: "field-control" }, preset),
    make("p", { class: "field-help" }, "Sets the modulus, the density and Poisson's ratio below. Woods with a grain are chosen for regions."),
  );

  /** Materials by name that are the same in all directions, as a solid without regions is. */
  const presets = () => materials.all.filter((material) => !material.wood);

  function takePreset() {
    const material = materials.named(preset.value);
    for (const [path, key] of material ? CONSTANTS : []) {
      fields.find((field) => field.path.join(".") === path)?.write(material?.[key]);
      edited.add(path);
    }
    tell("");
    show();
  }

  /** @returns {string} name of the material that the settings are those of; empty if there is none */
  function presetNow() {
    const settings = state.current?.settings;
    const is = (/** @type {import("../types.js").NamedMaterial} */ material) =>
      CONSTANTS.every(([path, key]) => valueAt(settings, path.split(".")) === material[key]);
    return presets().find(is)?.name ?? "";
  }

  /** @param {Event} event */
  async function send(event) {
    event.preventDefault();
    const changes = readChanges();
    if (changes === null) return;
    apply.disabled = true;
    try {
      await connection.call("change_settings", { settings: changes });
      edited.clear();
      tell("Applied.");
    } catch (error) {
      tell(sentenceOf(error), true);
    }
    show();
  }

  /** @returns {Record<string, unknown> | null} nested as projects are; `null` if one is wrong */
  function readChanges() {
    /** @type {Record<string, any>} */
    const changes = {};
    /** @type {Field | null} */
    let wrong = null;
    for (const field of fields) {
      if (!edited.has(field.path.join("."))) continue;
      try {
        const value = field.read();
        field.complain("");
        if (!isSame(value, valueAt(state.current?.settings, field.path))) put(changes, field.path, value);
      } catch (error) {
        if (!(error instanceof FieldError)) throw error;
        field.complain(error.message);
        wrong ??= field;
      }
    }
    if (wrong) {
      wrong.element.closest("details")?.setAttribute("open", "");
      wrong.focus();
      return null;
    }
    return changes;
  }

  /**
   * @param {string} text
   * @param {boolean} [isError]
   */
  function tell(text, isError = false) {
    setText(said, text);
    said.classList.toggle("field-error", isError);
  }

  function show() {
    const hasRegions = (state.current?.regions.length ?? 0) > 0;
    for (const field of fields) {
      field.element.hidden = hasRegions && TOLD_BY_REGIONS.includes(field.path.join("."));
      const isEdited = edited.has(field.path.join("."));
      if (!isEdited) field.write(valueAt(state.current?.settings, field.path));
      field.mark(isEdited);
    }
    presetRow.hidden = hasRegions;
    if (!CONSTANTS.some(([path]) => edited.has(path))) preset.value = presetNow();
    apply.disabled = edited.size === 0 || !state.current;
    discard.disabled = edited.size === 0;
    const many = edited.size === 1 ? "1 change waits" : `${edited.size} changes wait`;
    setText(apply, edited.size ? `Apply (${many})` : "Apply");
  }

  /**
   * @param {string[]} path
   * @param {Schema} schema
   */
  function fieldOf(path, schema) {
    /** @type {Field} */
    const field = makeField(path, schema, () => {
      edited.add(path.join("."));
      field.complain("");
      tell("");
      show();
    });
    return field;
  }

  /** @param {Schema} schema */
  function build(schema) {
    const all = leaves(schema).filter(([path, part]) => !ELSEWHERE.includes(path[0] ?? "") && isShown(part));
    fields = all.map(([path, part]) => fieldOf(path, part));
    const byPath = new Map(fields.map((field) => [field.path.join("."), field]));
    const first = IMPORTANT.map((path) => byPath.get(path)).filter((field) => field !== undefined);
    const others = fields.filter((field) => !first.includes(field));
    const groups = Object.entries(SECTIONS).map(([key, name]) => {
      const here = others.filter((field) => (field.path.length > 1 ? field.path[0] : "") === key);
      if (here.length === 0) return null;
      return make("fieldset", {}, make("legend", {}, name), ...here.map((field) => field.element));
    });
    body.replaceChildren(
      presetRow,
      ...first.map((field) => field.element),
      make("details", { class: "more" }, make("summary", {}, "More settings"), ...groups),
    );
    show();
  }

  async function load() {
    try {
      build(await connection.json("/schema.json"));
    } catch (error) {
      const again = button("Try again", load);
      body.replaceChildren(
        make("p", { class: "hint" }, `The settings could not be read: ${sentenceOf(error)}`),
        again,
      );
    }
  }

  materials.onLoad(() => {
    preset.replaceChildren(make("option", { value: "" }, "of its own"), ...presets().map(optionOf));
    show();
  });
  state.onChange((now, before) => {
    if (!before || now.settings !== before.settings || now.regions !== before.regions) show();
  });
  show();
  void load();
}

/**
 * All settings of a schema, those of sections after their section's name.
 *
 * @param {Schema} schema
 * @returns {[string[], Schema][]}
 */
function leaves(schema) {
  return Object.entries(schema.properties ?? {}).flatMap(([key, part]) =>
    part.properties
      ? leaves(part).map(([path, leaf]) => /** @type {[string[], Schema]} */ ([[key, ...path], leaf]))
      : [/** @type {[string[], Schema]} */ ([[key], part])],
  );
}

/**
 * @param {any} values
 * @param {string[]} path
 */
function valueAt(values, path) {
  return path.reduce((value, key) => value?.[key], values);
}

/**
 * @param {Record<string, any>} values
 * @param {string[]} path
 * @param {unknown} value
 */
function put(values, path, value) {
  const [key = "", ...rest] = path;
  if (rest.length === 0) {
    values[key] = value;
  } else {
    values[key] ??= {};
    put(values[key], rest, value);
  }
}

/**
 * @param {unknown} one
 * @param {unknown} other
 */
function isSame(one, other) {
  return JSON.stringify(one) === JSON.stringify(other ?? null);
}

/** @param {unknown} error */
function sentenceOf(error) {
  return error instanceof Error ? error.message : String(error);
}
