/** Values of settings: what a schema says of them, how they are written and read. */

/**
 * @typedef {object} Schema what is used of a JSON schema
 * @property {string} [description]
 * @property {string | string[]} [type]
 * @property {string[]} [enum]
 * @property {unknown} [default]
 * @property {number} [minimum]
 * @property {number} [maximum]
 * @property {number} [exclusiveMinimum]
 * @property {number} [exclusiveMaximum]
 * @property {string} [pattern] of one word that stands in place of a number
 * @property {Schema} [items]
 * @property {Record<string, Schema>} [properties]
 */

/** What is wrong with a field, in one sentence. */
export class FieldError extends Error {}

/**
 * The range that a number may have, in words; empty if it has none.
 *
 * @param {Schema} schema
 */
export function boundsOf(schema) {
  const low = schema.minimum ?? schema.exclusiveMinimum;
  const high = schema.maximum ?? schema.exclusiveMaximum;
  const parts = [];
  if (low !== undefined) parts.push(`${schema.minimum === undefined ? "above" : "at least"} ${written(low)}`);
  if (high !== undefined) parts.push(`${schema.maximum === undefined ? "below" : "at most"} ${written(high)}`);
  return parts.join(", ");
}

/**
 * Reads a number that somebody typed.
 *
 * @param {string} text
 * @param {Schema} schema
 * @param {string} name for the sentence
 * @returns {number | string | null}
 */
export function readNumber(text, schema, name) {
  const kinds = typesOf(schema);
  const trimmed = text.trim();
  const word = wordOf(schema);
  if (trimmed === "" && kinds.includes("null")) return null;
  if (word && trimmed === word) return word;
  const expected = `expected ${kinds.includes("integer") ? "a whole number" : "a number"}`;
  const bounds = boundsOf(schema);
  const others = (word ? ` or ${word}` : "") + (kinds.includes("null") ? " or nothing" : "");
  const wrong = () =>
    new FieldError(`${name}: found ${trimmed || "nothing"}, ${expected}${bounds ? ` of ${bounds}` : ""}${others}.`);
  if (!/^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(trimmed)) throw wrong();
  const value = Number(trimmed);
  const fits =
    Number.isFinite(value) &&
    (!kinds.includes("integer") || Number.isInteger(value)) &&
    value >= (schema.minimum ?? -Infinity) &&
    value <= (schema.maximum ?? Infinity) &&
    value > (schema.exclusiveMinimum ?? -Infinity) &&
    value < (schema.exclusiveMaximum ?? Infinity);
  if (!fits) throw wrong();
  return value;
}

/**
 * A description without the unit at its end, and the unit.
 *
 * @param {string} description
 * @returns {[string, string | null]}
 */
export function divided(description) {
  const found = /^(.*?)\s*\[([^\]]+)\]$/s.exec(description.trim());
  if (!found) return [description.trim(), null];
  return [found[1] ?? "", (found[2] ?? "").replace("^3", "\u00b3").replace("^2", "\u00b2")];
}

/**
 * Types that a value may have.
 *
 * @param {Schema} schema
 */
export function typesOf(schema) {
  if (schema.type === undefined) return [];
  return Array.isArray(schema.type) ? schema.type : [schema.type];
}

/**
 * The word that stands in place of a number; `null` if there is none.
 *
 * @param {Schema} schema
 */
function wordOf(schema) {
  return schema.pattern ? schema.pattern.replace(/^\^/, "").replace(/(\\Z|\$)$/, "") : null;
}

/**
 * A value in words.
 *
 * @param {unknown} value
 * @param {Schema} schema
 */
export function shown(value, schema) {
  if (value === null || value === undefined) return "empty";
  if (typesOf(schema).includes("boolean")) return value ? "on" : "off";
  return Array.isArray(value) ? value.map(written).join(" to ") : written(value);
}

/**
 * A number as it is typed, with an exponent where that is shorter.
 *
 * @param {unknown} value
 */
export function written(value) {
  if (value === null || value === undefined) return "";
  if (typeof value !== "number") return String(value);
  const plain = String(value);
  const short = value.toExponential().replace("e+", "e");
  return plain.length > 6 && short.length < plain.length ? short : plain;
}
