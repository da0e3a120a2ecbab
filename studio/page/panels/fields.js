/** Fields of a form that are made from a schema: labels, help, what was typed and what is wrong with it. */

import { identifier, make, setAttribute, setText } from "./dom.js";
import { boundsOf, divided, FieldError, readNumber, shown, typesOf, written } from "./values.js";

/** @typedef {import("./values.js").Schema} Schema */

/**
 * @typedef {object} Field
 * @property {string[]} path keys that lead to its value
 * @property {HTMLElement} element
 * @property {() => unknown} read what was typed; throws `FieldError`
 * @property {(value: unknown) => void} write shows a value
 * @property {(sentence: string) => void} complain shows what is wrong; nothing if empty
 * @property {(changed: boolean) => void} mark shows whether it waits to be applied
 * @property {() => void} focus
 */

const GIGA = 1e9;

/** @type {Record<string, string>} */
const NAMES = {
  resolution: "Resolution",
  coarsen: "Coarse solid",
  modes: "Modes",
  "optimiser.seconds": "Time of a search",
  density: "Density",
  "material.young": "Young's modulus at the start",
  "weights.frequency": "Weight of frequencies",
  "weights.amplitude": "Weight of amplitudes",
  "weights.regulariser": "Weight of roughness",
  poisson: "Poisson's ratio",
  fill: "Filling of voxels",
  "material.law": "Law of the field",
  "material.dimensions": "Dimensions of the field",
  "material.young_bounds": "Bounds of the modulus",
  "material.poisson_bounds": "Bounds of Poisson's ratio",
  "damping.source": "Source of dampings",
  "damping.regions": "Regions of loss factors",
  "optimiser.fine_check": "Check on the fine solid",
  "optimiser.evaluations": "Evaluations at most",
  "optimiser.population": "Offspring of a generation",
};

/**
 * Whether a page may show a setting: files are the server's own, and names of regions have no field.
 *
 * @param {Schema} schema
 */
export function isShown(schema) {
  const kinds = typesOf(schema);
  const ofItems = schema.items ? typesOf(schema.items) : [];
  return Boolean(schema.enum || schema.pattern) || ![...kinds, ...ofItems].includes("string");
}

/**
 * Makes the field of a setting.
 *
 * @param {string[]} path
 * @param {Schema} schema
 * @param {() => void} changed is told when somebody types
 * @returns {Field}
 */
export function makeField(path, schema, changed) {
  const [, unit] = divided(schema.description ?? "");
  if (unit === "Pa") return inGigapascals(makeField(path, gigapascalsOf(schema), changed));
  const frame = frameOf(path, schema);
  const kinds = typesOf(schema);
  if (schema.enum) return choiceField(frame, schema.enum, changed);
  if (kinds.includes("boolean")) return switchField(frame, changed);
  if (kinds.includes("array")) return pairField(frame, schema, changed);
  return numberField(frame, schema, changed);
}

/**
 * A schema of pascals for a field that shows gigapascals, as all of the page does.
 *
 * @param {Schema} schema
 * @returns {Schema}
 */
function gigapascalsOf(schema) {
  const { minimum, maximum, items, description = "" } = schema;
  return {
    ...schema,
    description: description.replace("[Pa]", "[GPa]"),
    default: scaled(schema.default, 1 / GIGA),
    ...(minimum !== undefined && { minimum: minimum / GIGA }),
    ...(maximum !== undefined && { maximum: maximum / GIGA }),
    ...(items && { items: gigapascalsOf(items) }),
  };
}

/**
 * A field of gigapascals as one of pascals.
 *
 * @param {Field} field
 * @returns {Field}
 */
function inGigapascals(field) {
  return {
    ...field,
    read: () => scaled(field.read(), GIGA),
    write: (value) => field.write(scaled(value, 1 / GIGA)),
  };
}

/**
 * A number, or several, times a factor, without the digits that rounding adds.
 *
 * @param {unknown} value
 * @param {number} factor
 * @returns {unknown}
 */
function scaled(value, factor) {
  if (Array.isArray(value)) return value.map((each) => scaled(each, factor));
  return typeof value === "number" ? Number((value * factor).toPrecision(12)) : value;
}

/**
 * @typedef {object} Frame what all fields have in common
 * @property {string[]} path
 * @property {string} name
 * @property {string} control identifier of the control
 * @property {string} describedBy
 * @property {HTMLElement} element
 * @property {HTMLElement} place of the control
 * @property {(sentence: string) => void} complain
 * @property {(changed: boolean) => void} mark
 */

/**
 * @param {string[]} path
 * @param {Schema} schema
 * @returns {Frame}
 */
function frameOf(path, schema) {
  const name = nameOf(path);
  const [said, unit] = divided(schema.description ?? "");
  const control = identifier("field");
  const help = identifier("help");
  const error = identifier("error");
  const bounds = typesOf(schema).includes("array") ? "" : boundsOf(schema);
  const facts = [bounds && `${sentence(bounds)}.`, `Default: ${shown(schema.default, schema)}.`];
  // Files write null where a form has an empty field.
  const meaning = said.replaceAll("if null", "if left empty");
  const place = make("div", { class: "field-control" });
  const mistake = make("p", { class: "field-error", id: error, hidden: true });
  const isPair = typesOf(schema).includes("array");
  const label = isPair
    ? make("span", { class: "field-label", id: `${control}-label` }, name)
    : make("label", { class: "field-label", for: control }, name);
  if (unit && unit !== "1") label.append(make("span", { class: "field-unit" }, ` [${unit}]`));
  const element = make(
    "div",
    { class: "field", ...(isPair && { role: "group", "aria-labelledby": `${control}-label` }) },
    label,
    place,
    make("p", { class: "field-help", id: help }, `${meaning}. ${facts.filter(Boolean).join(" ")}`),
    mistake,
  );
  return {
    path,
    name,
    control,
    describedBy: `${error} ${help}`,
    element,
    place,
    complain: (text) => {
      setText(mistake, text);
      mistake.hidden = text === "";
      for (const input of place.querySelectorAll("input, select")) {
        setAttribute(input, "aria-invalid", text ? "true" : null);
      }
    },
    mark: (changed) => element.classList.toggle("field-changed", changed),
  };
}

/**
 * @param {Frame} frame
 * @param {string[]} choices
 * @param {() => void} changed
 * @returns {Field}
 */
function choiceField(frame, choices, changed) {
  const select = make(
    "select",
    { id: frame.control, "aria-describedby": frame.describedBy, onchange: changed },
    ...choices.map((choice) => make("option", { value: choice }, choice)),
  );
  frame.place.append(select);
  return {
    ...frame,
    read: () => select.value,
    write: (value) => {
      select.value = String(value);
    },
    focus: () => select.focus(),
  };
}

/**
 * @param {Frame} frame
 * @param {() => void} changed
 * @returns {Field}
 */
function switchField(frame, changed) {
  const box = make("input", {
    type: "checkbox",
    id: frame.control,
    "aria-describedby": frame.describedBy,
    onchange: changed,
  });
  frame.place.append(box);
  return {
    ...frame,
    read: () => box.checked,
    write: (value) => {
      box.checked = value === true;
    },
    focus: () => box.focus(),
  };
}

/**
 * @param {Frame} frame
 * @param {Schema} schema
 * @param {() => void} changed
 * @returns {Field}
 */
function numberField(frame, schema, changed) {
  const input = numberInput(frame, schema, changed, { id: frame.control });
  frame.place.append(input);
  return {
    ...frame,
    read: () => readNumber(input.value, schema, frame.name),
    write: (value) => {
      input.value = written(value);
    },
    focus: () => input.focus(),
  };
}

/**
 * Two numbers, the lower one first, or none.
 *
 * @param {Frame} frame
 * @param {Schema} schema
 * @param {() => void} changed
 * @returns {Field}
 */
function pairField(frame, schema, changed) {
  const item = schema.items ?? {};
  const low = numberInput(frame, item, changed, { "aria-label": `${frame.name}, lowest`, placeholder: "lowest" });
  const high = numberInput(frame, item, changed, { "aria-label": `${frame.name}, highest`, placeholder: "highest" });
  frame.place.append(low, make("span", { "aria-hidden": "true" }, "to"), high);
  return {
    ...frame,
    read: () => {
      if (low.value.trim() === "" && high.value.trim() === "") return null;
      const pair = [low, high].map((input) => readNumber(input.value, item, frame.name));
      if (!(Number(pair[0]) < Number(pair[1]))) {
        throw new FieldError(`${frame.name}: found ${written(pair[0])} to ${written(pair[1])}, expected the lower one first.`);
      }
      return pair;
    },
    write: (value) => {
      const pair = Array.isArray(value) ? value : [null, null];
      low.value = written(pair[0]);
      high.value = written(pair[1]);
    },
    focus: () => low.focus(),
  };
}

/**
 * @param {Frame} frame
 * @param {Schema} schema
 * @param {() => void} changed
 * @param {Record<string, unknown>} attributes
 */
function numberInput(frame, schema, changed, attributes) {
  return make("input", {
    type: "text",
    inputmode: typesOf(schema).includes("integer") && !schema.pattern ? "numeric" : "text",
    autocomplete: "off",
    spellcheck: "false",
    size: 9,
    "aria-describedby": frame.describedBy,
    oninput: changed,
    ...attributes,
  });
}

/** @param {string[]} path */
export function nameOf(path) {
  return NAMES[path.join(".")] ?? sentence((path[path.length - 1] ?? "").replaceAll("_", " "));
}

/** @param {string} text */
function sentence(text) {
  return text.charAt(0).toUpperCase() + text.slice(1);
}
