/** Part of a plot's frequencies: chosen by dragging over them or by buttons, given up by a double click. */

import { button, make, setText } from "./dom.js";
import { withHertz } from "./numbers.js";

/** What a press on a button makes of the width, in decades. */
const STEP = 0.5;
const NARROWEST_DECADES = 0.02;

/** @typedef {[number, number]} Bounds [Hz] */

/**
 * Makes what zooms a plot with a logarithmic axis of frequencies.
 *
 * @param {() => import("uplot") | null} plot
 * @param {() => number | null} middle frequency that stays in the middle [Hz], if there is one
 */
export function makeZoom(plot, middle) {
  /** @type {Bounds | null} */
  let bounds = null;
  /** @type {Bounds} */
  let whole = [20, 20000];
  const closer = button("+", () => scale(STEP), { class: "small", "aria-label": "Fewer frequencies" });
  const wider = button("\u2212", () => scale(1 / STEP), { class: "small", "aria-label": "More frequencies" });
  const all = button("All", () => take(null), { class: "small", "aria-label": "All frequencies" });
  const buttons = make("div", { class: "row zoom", role: "group", "aria-label": "Frequencies shown" });
  const shown = make("span", { class: "hint", role: "status" });
  buttons.append(closer, wider, all, shown);

  /** @param {Bounds | null} next */
  function take(next) {
    bounds = next;
    wider.disabled = all.disabled = bounds === null;
    setText(shown, bounds ? `${withHertz(bounds[0])} to ${withHertz(bounds[1])}` : "all frequencies");
    const one = plot();
    if (one) one.setData(one.data, true);
  }

  /** @param {number} factor */
  function scale(factor) {
    const [low, high] = (bounds ?? whole).map(Math.log10);
    const least = Math.log10(whole[0]);
    const most = Math.log10(whole[1]);
    const width = Math.max(NARROWEST_DECADES, factor * ((high ?? most) - (low ?? least)));
    if (width >= most - least) {
      take(null);
      return;
    }
    const hertz = middle();
    const wished = hertz === null ? ((low ?? least) + (high ?? most)) / 2 : Math.log10(hertz);
    const centre = Math.min(most - width / 2, Math.max(least + width / 2, wished));
    take([10 ** (centre - width / 2), 10 ** (centre + width / 2)]);
  }

  /** @param {import("uplot")} one whose part was dragged over */
  function select(one) {
    const { left, width } = one.select;
    if (width < 1) return;
    const chosen = /** @type {Bounds} */ ([one.posToVal(left, "x"), one.posToVal(left + width, "x")]);
    one.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    if (Math.log10(chosen[1] / chosen[0]) >= NARROWEST_DECADES) take(chosen);
  }

  take(null);
  return {
    buttons,
    /** What of all frequencies the axis shows. @param {Bounds} every */
    range(every) {
      whole = every;
      return bounds ?? whole;
    },
    /** Part of the plot's options. @type {import("uplot").Cursor} */
    cursor: {
      y: false,
      drag: { x: true, y: false, setScale: false },
      bind: { dblclick: () => () => (take(null), null) },
    },
    select,
  };
}
