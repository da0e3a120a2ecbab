/** Rows of regions and supports: which one is selected, what is asked of the server, what went wrong. */

import { make, setText } from "./dom.js";

/** @typedef {import("../main.js").Parts} Parts */
/** @typedef {import("../types.js").RowKind} RowKind */
/** @typedef {import("../types.js").Placed} Placed */

/**
 * Rows of one kind.
 *
 * @typedef {object} Rows
 * @property {() => number | null} chosen number of the selected row
 * @property {(number: number) => void} choose
 * @property {(row: Record<string, unknown>) => Promise<boolean>} addRow and selects it
 * @property {(changes: Record<string, unknown>) => Promise<boolean>} change keys of the selected row
 * @property {() => void} remove the selected row
 * @property {(by: number) => void} move the selected row up or down
 * @property {(number: number) => string | null} faultOf what is wrong with a row
 * @property {(number: number, sentence: string) => void} complain of a row
 */

/** What places a row in another way is left out of it. */
const NO_PLACE = { where: null, painted: null };
/** @type {Record<RowKind, Record<string, null>>} */
const OTHER_PLACES = {
  regions: { ...NO_PLACE, box: null, mesh: null, part: null, labels: null, label: null, unit: null, depth: null },
  supports: { ...NO_PLACE, at: null, radius: null },
};

/**
 * @param {Parts} parts
 * @param {RowKind} kind
 * @param {() => void} show called when something else is wrong
 * @returns {Rows}
 */
export function makeRows(parts, kind, show) {
  const { connection, selection, state } = parts;
  /** What the server refused, by number of the row. @type {Map<number, string>} */
  const refused = new Map();

  const chosen = () => {
    const { row } = selection.current;
    return row?.kind === kind ? row.number : null;
  };

  /** @param {string} name @param {number} number @param {Record<string, unknown>} values */
  async function ask(name, number, values) {
    try {
      await connection.call(name, { kind, ...values });
      refused.clear();
      return true;
    } catch (error) {
      refused.set(number, error instanceof Error ? error.message : String(error));
      return false;
    } finally {
      show();
    }
  }

  return {
    chosen,
    choose: (number) => selection.set({ row: { kind, number }, pending: null }),
    addRow: async (row) => {
      const number = state.current?.[kind].length ?? 0;
      if (!(await ask("add_row", Math.max(0, number - 1), { row }))) return false;
      selection.set({ row: { kind, number }, pending: null });
      return true;
    },
    change: async (changes) => {
      const number = chosen();
      return number !== null && ask("change_row", number, { number, changes });
    },
    remove: () => {
      const number = chosen();
      if (number !== null) void ask("remove_row", number, { number });
    },
    move: (by) => {
      const number = chosen();
      if (number === null) return;
      const to = number + by;
      void ask("move_row", number, { number, to }).then((done) => {
        if (done) selection.set({ row: { kind, number: to } });
      });
    },
    faultOf: (number) => refused.get(number) ?? state.current?.[kind][number]?.fault ?? null,
    complain: (number, sentence) => {
      refused.set(number, sentence);
      show();
    },
  };
}

/**
 * Changes that give a row another place.
 *
 * @param {RowKind} kind
 * @param {Record<string, unknown>} place
 */
export function placedBy(kind, place) {
  return { ...OTHER_PLACES[kind], ...place };
}

/**
 * Buttons and the brush with which a row is painted.
 *
 * @param {Parts} parts
 * @param {Rows} rows
 */
export function makePaintControls(parts, rows) {
  const { selection } = parts;
  /** @param {boolean} erasing @param {string} text */
  const tool = (erasing, text) =>
    make("button", {
      type: "button",
      onclick: () => {
        const on = selection.current.tool === "paint" && selection.current.erasing === erasing;
        selection.set(on ? { tool: "strike" } : { tool: "paint", erasing, colouring: "regions" });
      },
    }, text);
  const paint = tool(false, "Paint");
  const erase = tool(true, "Take paint away");
  const size = make("input", {
    type: "range",
    min: 0.01,
    max: 0.3,
    step: 0.005,
    oninput: () => selection.set({ brush: Number(size.value) }),
  });
  const told = make("output");
  const clear = make("button", { type: "button", onclick: () => void rows.change({ painted: [] }) }, "Clear");
  const element = make(
    "div",
    { class: "paint-controls" },
    make("div", { class: "row", role: "group", "aria-label": "Paint" }, paint, erase, clear),
    make("label", { class: "brush" }, "Brush ", size, told),
  );

  /** @param {Placed | undefined} row */
  function show(row) {
    element.hidden = !row || row.dabs === null;
    if (element.hidden) return;
    const { tool: now, erasing, brush } = selection.current;
    paint.setAttribute("aria-pressed", String(now === "paint" && !erasing));
    erase.setAttribute("aria-pressed", String(now === "paint" && erasing));
    clear.disabled = row?.dabs === 0;
    size.value = String(brush);
    const side = parts.state.current?.solid?.longest_side_m;
    setText(told, side ? ` ${lengthOf(brush * side)}` : "");
  }

  return { element, show };
}

/** @param {number} metres @returns {string} with a unit in which it is easily read */
export function lengthOf(metres) {
  const millimetres = 1000 * metres;
  return millimetres < 100 ? `${Number(millimetres.toPrecision(2))} mm` : `${Number((millimetres / 10).toPrecision(3))} cm`;
}

/**
 * How a row that is painted, or where an expression holds, is told in the list.
 *
 * @param {Placed} row
 * @returns {string | null}
 */
export function placeOf(row) {
  if (row.dabs === 0) return "nothing painted yet";
  if (row.dabs !== null) return "painted";
  return row.where === undefined ? null : row.where.startsWith("region:") ? `region ${row.where.slice(7)}` : row.where;
}
