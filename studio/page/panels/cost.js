/** The cost over the time of the search, with its parts. */

import { keepList, make, setAttribute, setText } from "./dom.js";
import { explanations } from "./cost-words.js";
import { makeLegend } from "./legend.js";
import { change, significant, withSeconds } from "./numbers.js";
import { axis, colour, makePlot, roundNumbers } from "./plots.js";

/** @typedef {import("../types.js").Progress} Progress */
/** @typedef {import("../types.js").FineCheck} FineCheck */
/** @typedef {import("./legend.js").Sign} Sign */

const HEIGHT = 200;
/** More points than that are not seen; every second one is left out then. */
const MOST_ROWS = 1000;
/** Parts this far below the cost say nothing, and would squeeze what does. */
const LEAST_SHARE = 1e-4;
const MET = "The search ended before its time: the frequencies are met, and the cost falls no more.";

/** @type {{ key: keyof Progress, text: string, sign: Sign, kind: string, dash: number[], width: number }[]} */
const SERIES = [
  { key: "cost", text: "cost", sign: "line", kind: "cost-all", dash: [], width: 2 },
  { key: "frequency_cost", text: "frequencies", sign: "dashed", kind: "cost-frequency", dash: [6, 3], width: 1.5 },
  { key: "amplitude_cost", text: "amplitudes", sign: "dotted", kind: "cost-amplitude", dash: [2, 3], width: 1.5 },
  { key: "regulariser", text: "roughness", sign: "dash-dotted", kind: "cost-rough", dash: [8, 3, 2, 3], width: 1.5 },
];

/**
 * Makes the plot of the cost.
 *
 * @param {HTMLElement} element
 * @param {import("../main.js").Parts} parts
 */
export function makeCost(element, parts) {
  const { connection } = parts;
  /** @type {Progress[]} */
  let rows = [];
  /** @type {FineCheck[]} */
  let checks = [];
  /** Cost on the fine solid of the material that sounds; null if it is not known. @type {number | null} */
  let present = null;
  /** Whether the design that sounds is like its clips, in words. @type {string | null} */
  let verdict = null;
  /** Partials of the clips that no mode can have. @type {number[]} */
  let leftOut = [];
  let isMet = false;
  /** @type {import("uplot") | null} */
  let plot = null;
  let isWaiting = false;

  const none = make("p", { class: "hint" }, "Optimise, and the cost is drawn here while it falls.");
  const judged = make("p", { class: "verdict", role: "status", hidden: true });
  const value = make("p", { class: "figure-line" });
  const picture = make("div", { class: "plot", role: "img" });
  const says = make("ul", { class: "says", hidden: true });
  const body = make(
    "div",
    { hidden: true },
    value,
    makeLegend(SERIES.map(({ sign, text, kind }) => ({ sign, text, kind }))),
    picture,
    says,
  );
  const missing = make("p", { class: "hint", hidden: true });
  const met = make("p", { class: "hint", hidden: true }, MET);
  element.append(none, judged, missing, met, body);

  function show() {
    isWaiting = false;
    judged.hidden = verdict === null;
    setText(judged, verdict === null ? "" : `Verdict: ${verdict}.`);
    missing.hidden = leftOut.length === 0;
    const hertz = leftOut.map((each) => each.toFixed(0)).join(", ");
    setText(missing, `No mode of this solid can have the clips' partials at ${hertz} Hz: they are left out.`);
    met.hidden = !isMet;
    none.hidden = rows.length > 0;
    body.hidden = rows.length === 0;
    const first = rows[0];
    const last = rows[rows.length - 1];
    if (!first || !last) return;
    const compared = rows.length > 1 ? `, ${change(first.cost, last.cost)}` : "";
    const effort = `${last.evaluations} ${last.evaluations === 1 ? "evaluation" : "evaluations"} in ${withSeconds(last.seconds)}`;
    const [fineFirst] = checks;
    const fineCost = present ?? Math.min(...checks.map((check) => check.cost));
    const told = fineFirst
      ? `${significant(fineCost, 4)} on the fine solid, ${change(fineFirst.cost, fineCost)}`
      : `${significant(last.cost, 4)}${compared}`;
    setText(value, `${told}; ${effort}`);
    keepList(says, explanations(rows, checks, present), (_text, index) => String(index), () => make("li"), setText);
    says.hidden = says.children.length === 0;
    setAttribute(
      picture,
      "aria-label",
      `Cost over ${withSeconds(last.seconds)}: from ${significant(first.cost)} to ${significant(last.cost)}; of ` +
        `frequencies ${significant(last.frequency_cost)}, of amplitudes ${significant(last.amplitude_cost)}, ` +
        `of roughness ${significant(last.regulariser)}.`,
    );
    plot ??= create();
    plot.setData([rows.map((row) => row.seconds), ...SERIES.map(({ key }) => rows.map((row) => positive(row[key])))]);
  }

  function create() {
    return makePlot(
      picture,
      HEIGHT,
      {
        scales: {
          x: { time: false, range: (_one, _low, high) => [0, high > 0 ? high : 1] },
          y: { distr: 3, range: costRange },
        },
        axes: [
          axis("Processor time [s]", { size: 34 }),
          axis("Cost", {
            size: 54,
            // Those of the library have no end where the lowest is between two powers of ten.
            splits: (_one, _axis, low, high) => roundNumbers(low, high),
            values: (_one, splits) => splits.map((split) => (split === null ? "" : significant(split, 1))),
          }),
        ],
        series: [
          {},
          ...SERIES.map(({ text, kind, dash, width }) => ({
            label: text,
            stroke: () => colour(`--plot-${kind}`),
            width,
            dash,
            // The first value alone is no line.
            points: { show: (/** @type {import("uplot")} */ one) => one.data[0].length < 2 },
          })),
        ],
      },
      [[0], ...SERIES.map(() => [null])],
    );
  }

  /** @param {import("uplot")} one @returns {[number, number]} */
  function costRange(one) {
    const costs = Array.from(one.data[1] ?? [], Number).filter((cost) => cost > 0);
    if (costs.length === 0) return [0.1, 1];
    const least = Math.min(...costs) * LEAST_SHARE;
    const there = one.data.slice(1).flatMap((column) => Array.from(column, Number).filter((each) => each > least));
    return [Math.min(...there) / 1.5, Math.max(...there) * 1.5];
  }

  function later() {
    while (rows.length > MOST_ROWS) rows = rows.filter((_row, index) => index % 2 === 0 || index === rows.length - 1);
    if (isWaiting) return;
    isWaiting = true;
    requestAnimationFrame(show);
  }

  connection.onBinary("bank", (header) => {
    present = header.checked ? header.cost : null;
    verdict = header.verdict ?? null;
    leftOut = header.left_out_hz ?? [];
    isMet = header.ended_by === "met";
    later();
  });
  connection.onEvent("history", (event) => {
    rows = [...event.rows];
    checks = event.checks;
    later();
  });
  connection.onEvent("progress", (event) => {
    const last = rows[rows.length - 1];
    // Time runs one way: a row from before the last one is of another search.
    if (last && event.seconds < last.seconds) rows = [];
    rows.push(event);
    checks = event.checks;
    later();
  });
}

/** @param {unknown} value @returns {number | null} as logarithms need it */
function positive(value) {
  return typeof value === "number" && value > 0 ? value : null;
}
