/** The solid of a design: its material as colours, its targets, strikes anywhere. */

import { span } from "../page/solid/colours.js";
import { Gestures } from "../page/solid/gestures.js";
import { makeLegend } from "../page/solid/legend.js";
import { Marks } from "../page/solid/marks.js";
import { View } from "../page/solid/view.js";

/** @typedef {import("./main.js").Page} Page */

const HELP =
  "The solid in 3D. Arrow keys turn it, Shift and arrow keys shift it, plus and minus zoom, " +
  "blank strikes it in the middle of the view, Enter strikes the selected target.";

/**
 * Mean inward directions at vertices, for arrows: by the areas of the triangles there.
 *
 * @param {Float32Array} positions (V, 3)
 * @param {Uint32Array} triangles (F, 3)
 * @returns {Float32Array} (V, 3)
 */
export function inwardOf(positions, triangles) {
  const sums = new Float32Array(positions.length);
  let volume = 0;
  /** @param {number} vertex @param {number} axis @returns {number} */
  const p = (vertex, axis) => positions[3 * vertex + axis];
  for (let i = 0; i < triangles.length; i += 3) {
    const [a, b, c] = triangles.subarray(i, i + 3);
    const u = [0, 1, 2].map((axis) => p(b, axis) - p(a, axis));
    const v = [0, 1, 2].map((axis) => p(c, axis) - p(a, axis));
    const normal = [0, 1, 2].map((axis) => {
      const [j, k] = [(axis + 1) % 3, (axis + 2) % 3];
      return u[j] * v[k] - u[k] * v[j];
    });
    for (let axis = 0; axis < 3; axis++) {
      volume += normal[axis] * p(a, axis);
      for (const vertex of [a, b, c]) sums[3 * vertex + axis] -= normal[axis];
    }
  }
  // Triangles that all face inwards enclose a negative volume.
  const sign = volume < 0 ? -1 : 1;
  for (let i = 0; i < sums.length; i += 3) {
    const size = Math.hypot(sums[i], sums[i + 1], sums[i + 2]) || 1;
    for (let axis = 0; axis < 3; axis++) sums[i + axis] *= sign / size;
  }
  return sums;
}

/**
 * @param {HTMLElement} element
 * @param {Page} page
 * @returns {View | null} null where the browser draws no 3D
 */
export function showSolid(element, page) {
  const { design, selection, keys } = page;
  keys.add("Enter", "Strike the selected target", () => {
    const target = design.targets.find(({ name }) => name === selection.current.target);
    if (!target) return false;
    page.strike(target.vertex);
  });
  for (let digit = 1; digit <= 9; digit++) {
    keys.add(String(digit), `Strike the last point again, with strength ${digit}/9`, () => {
      if (selection.current.vertex === null) return false;
      page.strike(selection.current.vertex, digit / 9);
    });
  }
  /** @param {string} className @param {HTMLElement} [within] @returns {HTMLElement} */
  const layer = (className, within = element) => {
    const made = document.createElement("div");
    made.className = className;
    within.append(made);
    return made;
  };
  layer("crosshair").ariaHidden = "true";
  const labels = layer("marks");
  const gauge = layer("gauge");
  gauge.hidden = true;
  gauge.ariaHidden = "true";
  const below = layer("standalone-legend");
  const legend = makeLegend(layer("", below));
  let view;
  try {
    view = new View(element);
  } catch (error) {
    const notice = document.createElement("p");
    notice.className = "notice graphics";
    notice.textContent = /** @type {Error} */ (error).message;
    layer("notices").append(notice);
    return null;
  }
  view.canvas.setAttribute("role", "application");
  view.canvas.setAttribute("aria-label", HELP);
  const { young } = design.bank;
  const spanned = span(young, null);
  legend.show(spanned);
  view.margins = () => [0, below.offsetHeight];
  view.setSurface(design.positions, design.triangles);
  view.surface?.paint(young, spanned);
  const marks = new Marks(view, labels, (name) => selection.set({ target: name }));
  marks.setInward(inwardOf(design.positions, design.triangles));
  selection.onChange((now) => marks.show(design.targets, now.target));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => marks.takeColours());
  new Gestures(view, marks, selection, gauge, {
    strike: (vertex, strength) => page.strike(vertex, strength),
    place: () => {},
    choose: (name) => selection.set({ target: name }),
    hover: (vertex) => legend.point(vertex === null ? null : young[vertex]),
  });
  keys.add("0", "See all of the solid", () => view.fit());
  return view;
}
