/** Fields of the form of a region or support: each shows a value of the row and tells what was typed. */

import { identifier, make, setValue } from "./dom.js";
import { FieldError, readNumber, written } from "./values.js";

// Places pressed on the solid have more than anybody reads.
const SHOWN_DIGITS = 4;

/**
 * @typedef {object} RowField
 * @property {HTMLElement} element
 * @property {(value: any, usual?: string) => void} show a value, and what holds without one
 */

/**
 * @typedef {object} Told
 * @property {(value: any) => void} take what was typed
 * @property {(sentence: string) => void} complain of it
 */

/**
 * @param {string} label
 * @param {string} control identifier
 * @param {(Node | string)[]} inside
 */
function paired(label, control, inside) {
  return make("div", { class: "pair" }, make("label", { for: control }, label), make("div", { class: "row" }, ...inside));
}

/**
 * A text; nothing is null.
 *
 * @param {string} label
 * @param {Told} told
 * @param {Record<string, unknown>} [attributes]
 * @returns {RowField}
 */
export function textField(label, told, attributes = {}) {
  const id = identifier("row");
  const input = make("input", {
    type: "text",
    id,
    autocomplete: "off",
    spellcheck: "false",
    onchange: () => told.take(input.value.trim() || null),
    ...attributes,
  });
  return { element: paired(label, id, [input]), show: (value) => setValue(input, value ?? "") };
}

/**
 * A number; nothing is null, and stands for what is usual.
 *
 * @param {string} label
 * @param {string} unit
 * @param {number} scale by which what is typed is multiplied
 * @param {Told} told
 * @returns {RowField}
 */
export function numberField(label, unit, scale, told) {
  const id = identifier("row");
  const input = make("input", {
    type: "text",
    inputmode: "text",
    id,
    size: 9,
    autocomplete: "off",
    onchange: () => {
      const value = numberIn(input.value, label, told);
      if (value !== undefined) told.take(value === null ? null : exact(value * scale));
    },
  });
  const element = paired(label, id, [input, make("span", { class: "field-unit" }, unit)]);
  return {
    element,
    show: (value, usual = "") => {
      setValue(input, value === undefined || value === null ? "" : written(exact(value / scale)));
      input.placeholder = usual;
    },
  };
}

/**
 * Three numbers.
 *
 * @param {string} label
 * @param {string} unit
 * @param {Told} told
 * @returns {RowField}
 */
export function vectorField(label, unit, told) {
  const id = identifier("row");
  const inputs = ["x", "y", "z"].map((axis, i) =>
    make("input", {
      type: "text",
      size: 5,
      id: i === 0 ? id : null,
      "aria-label": `${label}, ${axis}`,
      placeholder: axis,
      autocomplete: "off",
      onchange: take,
    }),
  );
  function take() {
    const values = inputs.map((input) => numberIn(input.value, label, told));
    if (values.every((value) => value === null)) told.take(null);
    else if (values.every((value) => typeof value === "number")) told.take(values);
  }
  const element = paired(label, id, [...inputs, ...(unit ? [make("span", { class: "field-unit" }, unit)] : [])]);
  return {
    element,
    show: (value) => inputs.forEach((input, i) => setValue(input, value ? written(Number(value[i].toPrecision(SHOWN_DIGITS))) : "")),
  };
}

/**
 * One of several.
 *
 * @param {string} label
 * @param {[string, string][]} choices values and texts
 * @param {Told} told
 * @returns {RowField & {offer: (choices: [string, string][]) => void}}
 */
export function choiceField(label, choices, told) {
  const id = identifier("row");
  const select = make("select", { id, onchange: () => told.take(select.value) });
  /** @param {[string, string][]} offered */
  const offer = (offered) => select.replaceChildren(...offered.map(([value, text]) => make("option", { value }, text)));
  offer(choices);
  return {
    element: paired(label, id, [select]),
    show: (value) => {
      select.value = String(value ?? "");
    },
    offer,
  };
}

/**
 * @param {string} text
 * @param {string} name
 * @param {Told} told
 * @returns {number | null | undefined} undefined if it is none, which is told
 */
function numberIn(text, name, told) {
  try {
    return /** @type {number | null} */ (readNumber(text, { type: ["number", "null"] }, name));
  } catch (error) {
    if (!(error instanceof FieldError)) throw error;
    told.complain(error.message);
    return undefined;
  }
}

/** @param {number} value @returns {number} without what multiplying has added */
function exact(value) {
  return Number(value.toPrecision(12));
}
