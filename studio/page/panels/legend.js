/** Legends of plots: the mark of each series beside its name. */

import { make } from "./dom.js";

const SVG = "http://www.w3.org/2000/svg";

/** @typedef {"disc" | "diamond" | "line" | "dashed" | "dotted" | "dash-dotted"} Sign */

/** @type {Record<Sign, [string, Record<string, string>]>} */
const SIGNS = {
  disc: ["circle", { cx: "12", cy: "6", r: "4.5", class: "filled" }],
  diamond: ["path", { d: "M12 0.7 17.3 6 12 11.3 6.7 6z" }],
  line: ["path", { d: "M1 6H23" }],
  dashed: ["path", { d: "M1 6H23", "stroke-dasharray": "6 3" }],
  dotted: ["path", { d: "M1 6H23", "stroke-dasharray": "2 3" }],
  "dash-dotted": ["path", { d: "M1 6H23", "stroke-dasharray": "8 3 2 3" }],
};

/**
 * A list of series.
 *
 * @param {{ sign: Sign, text: string, kind: string }[]} entries `kind` is a class with the series' colour
 * @returns {HTMLElement}
 */
export function makeLegend(entries) {
  return make(
    "ul",
    { class: "legend" },
    ...entries.map(({ sign, text, kind }) => {
      const [shape, attributes] = SIGNS[sign];
      const picture = document.createElementNS(SVG, "svg");
      const mark = document.createElementNS(SVG, shape);
      for (const [name, value] of Object.entries(attributes)) mark.setAttribute(name, value);
      picture.setAttribute("viewBox", "0 0 24 12");
      picture.setAttribute("aria-hidden", "true");
      picture.setAttribute("class", kind);
      picture.append(mark);
      return make("li", {}, picture, text);
    }),
  );
}
