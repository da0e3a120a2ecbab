/** Regions and supports on the surface: fetched, previewed while they are painted, shown as colours and hatching. */

import { Color, SRGBColorSpace } from "three";
import { coloursOf } from "../panels/materials.js";
import { styleOf } from "./palette.js";

/** @typedef {import("../main.js").Parts} Parts */
/** @typedef {import("../types.js").RowKind} RowKind */
/** @typedef {import("../types.js").CompositionArrays} CompositionArrays */
/** @typedef {import("../types.js").Support} Support */
/** @typedef {import("./surface.js").Surface} Surface */

/** x, y, z and radius [m]; a negative radius takes paint away. @typedef {[number, number, number, number]} Dab */

export const NONE = 65535;
/** Product of inward normals from which a vertex is on another side than a dab. */
const ANOTHER_SIDE = -0.3;

/** What a hatching stands for; 0 is none. */
export const HATCHES = { held: 1, spring: 2, pad: 2, mass: 0 };

/** @param {Support} support @returns {number} */
export function hatchOf(support) {
  if (support.mass !== undefined) return HATCHES.mass;
  return support.spring !== undefined || support.pad !== undefined ? HATCHES.spring : HATCHES.held;
}

/**
 * Marks the vertices that a dab paints.
 *
 * @param {Uint16Array} numbers of rows at the vertices; written
 * @param {number} number of the row that is painted
 * @param {Float32Array} positions (V, 3) [m]
 * @param {Dab} dab
 * @param {{inward: Float32Array, normal: ArrayLike<number>} | null} side inward normals of the vertices and at the
 *     dab, where paint stays on its side
 * @param {ArrayLike<number> | null} below what comes to light where paint is taken away; nothing without
 * @returns {boolean} whether anything has changed
 */
export function markDab(numbers, number, positions, [x, y, z, radius], side, below) {
  const square = radius * radius;
  let changed = false;
  for (let vertex = 0; vertex < numbers.length; vertex++) {
    const i = 3 * vertex;
    const away = (positions[i] - x) ** 2 + (positions[i + 1] - y) ** 2 + (positions[i + 2] - z) ** 2;
    if (away > square) continue;
    if (side && product(side.inward, i, side.normal) <= ANOTHER_SIDE) continue;
    if (radius < 0 && numbers[vertex] !== number) continue;
    const next = radius > 0 ? number : (below?.[vertex] ?? NONE);
    if (numbers[vertex] === next) continue;
    numbers[vertex] = next;
    changed = true;
  }
  return changed;
}

/** @param {Float32Array} values @param {number} i @param {ArrayLike<number>} other */
function product(values, i, other) {
  return values[i] * other[0] + values[i + 1] * other[1] + values[i + 2] * other[2];
}

export class Composition {
  /**
   * @param {Parts} parts
   * @param {() => void} changed called when something else is to be shown
   */
  constructor(parts, changed) {
    this.parts = parts;
    this.changed = changed;
    /** Number of what is shown, and of what is wanted. @type {number | null} */
    this.shown = null;
    /** @type {number | null} */
    this.wanted = null;
    /** @type {CompositionArrays | null} */
    this.arrays = null;
    parts.state.onChange((now) => this.#follow(now.composition));
    parts.materials.onLoad(changed);
  }

  /** @param {number | null} number that the server has now */
  async #follow(number) {
    if (this.wanted === number) return;
    this.wanted = number;
    if (number === null) {
      this.arrays = null;
      this.shown = null;
      this.changed();
      return;
    }
    try {
      const { arrays } = await this.parts.connection.binary(`/composition/${number}`);
      if (this.wanted !== number) return;
      const { region, support } = /** @type {any} */ (arrays);
      // Written while something is painted.
      this.arrays = { region: region.slice(), support: support.slice() };
      this.shown = number;
      this.changed();
    } catch {
      if (this.wanted === number) this.wanted = null; // the next state asks again
    }
  }

  /** Shows what the server has, in place of a preview. */
  fetchAgain() {
    const number = this.wanted;
    this.wanted = null;
    void this.#follow(number);
  }

  /** @param {Surface} surface @returns {CompositionArrays | null} those of the surface that is shown */
  of(surface) {
    return this.arrays && 3 * this.arrays.region.length === surface.positions.length ? this.arrays : null;
  }

  /**
   * Shows at once what the server will soon tell.
   *
   * @param {Surface} surface
   * @param {RowKind} kind
   * @param {number} number of the row
   * @param {Dab} dab
   * @param {{inward: Float32Array, normal: ArrayLike<number>}} side
   */
  preview(surface, kind, number, dab, side) {
    const arrays = this.of(surface);
    if (!arrays) return;
    const row = this.parts.state.current?.regions[number];
    const stays = kind === "supports" || row?.depth !== undefined;
    const numbers = kind === "regions" ? arrays.region : arrays.support;
    if (markDab(numbers, number, surface.positions, dab, stays ? side : null, null)) this.changed();
  }

  /** @returns {Color[]} of the regions */
  colours() {
    const { state, materials } = this.parts;
    return coloursOf(state.current?.regions ?? [], materials).map((colour) =>
      new Color().setRGB(...colour, SRGBColorSpace),
    );
  }

  /** @returns {Uint8Array | null} hatching at the vertices of a surface @param {Surface} surface */
  hatching(surface) {
    const arrays = this.of(surface);
    const supports = this.parts.state.current?.supports ?? [];
    if (!arrays || supports.length === 0) return null;
    const kinds = supports.map(hatchOf);
    return Uint8Array.from(arrays.support, (number) => kinds[number] ?? 0);
  }

  /** @returns {{text: string, style: string, hatch?: number}[]} what colours and hatchings stand for */
  legend() {
    const { state, materials } = this.parts;
    const { regions = [], supports = [] } = state.current ?? {};
    const colours = coloursOf(regions, materials);
    /** @type {{text: string, style: string, hatch?: number}[]} */
    const entries = regions.map(({ name }, i) => ({ text: name, style: styleOf(colours[i]) }));
    const byArea = supports.filter(({ at, radius }) => at === undefined || radius !== undefined);
    const hatches = new Set(byArea.map(hatchOf));
    if (hatches.has(HATCHES.held)) entries.push({ text: "held", style: "", hatch: HATCHES.held });
    if (hatches.has(HATCHES.spring)) entries.push({ text: "springs, pads", style: "", hatch: HATCHES.spring });
    return entries;
  }
}
