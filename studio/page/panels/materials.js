/** Named materials, and the constants that a region has of them and of its own. */

import { NO_COLOUR, apart } from "../solid/palette.js";
import { make } from "./dom.js";

/** @typedef {import("../types.js").NamedMaterial} NamedMaterial */
/** @typedef {import("../types.js").Region} Region */
/** @typedef {import("../types.js").Vector} Vector */

/**
 * What a region is made of.
 *
 * @typedef {object} Constants
 * @property {number} young [Pa]; of wood, along its grain
 * @property {number | null} poisson null of wood, which has three
 * @property {number} density [kg/m^3]
 * @property {number | null} loss at 1 kHz; null if it is not known
 * @property {boolean} wood whether it is not the same in all directions
 */

// As a region has them that names no material.
const YOUNG = 1e9;
const POISSON = 0.25;
const DENSITY = 1000;

/**
 * Named materials: `all` of them once they have come, and who wants to know of that.
 *
 * @typedef {object} Materials
 * @property {readonly NamedMaterial[]} all
 * @property {(name: string | undefined) => NamedMaterial | undefined} named
 * @property {(wanted: () => void) => void} onLoad called now if they are there, else once they are
 */

/**
 * @param {{connection: {json: (path: string) => Promise<any>}}} parts
 * @returns {Materials}
 */
export function makeMaterials({ connection }) {
  /** @type {NamedMaterial[]} */
  let all = [];
  /** @type {(() => void)[]} */
  const waiting = [];
  const load = async () => {
    try {
      all = await connection.json("/materials.json");
      for (const wanted of waiting) wanted();
    } catch {
      setTimeout(load, 2000); // without a server there is nothing else to do, either
    }
  };
  void load();
  return {
    get all() {
      return all;
    },
    named: (name) => all.find((one) => one.name === name),
    onLoad: (wanted) => {
      waiting.push(wanted);
      if (all.length > 0) wanted();
    },
  };
}

/**
 * @param {Region} region
 * @param {NamedMaterial | undefined} material that it names
 * @returns {Constants}
 */
export function constantsOf(region, material) {
  const density = region.density ?? material?.density ?? DENSITY;
  const loss = region.loss_factor ?? material?.loss_factor ?? null;
  if (region.grain_young) return { young: Math.max(...region.grain_young), poisson: null, density, loss, wood: true };
  const isWood = material?.grain_young && region.young === undefined && region.poisson === undefined;
  if (isWood) return { young: material.grain_young?.[0] ?? material.young, poisson: null, density, loss, wood: true };
  const young = region.young ?? material?.young ?? YOUNG;
  const poisson = region.poisson ?? material?.poisson ?? POISSON;
  return { young, poisson, density, loss, wood: false };
}

/**
 * @param {Region} region
 * @param {NamedMaterial | undefined} material
 * @returns {Vector | null} direction of its grain; null if it has none
 */
export function grainOf(region, material) {
  return constantsOf(region, material).wood ? (region.grain ?? [1, 0, 0]) : null;
}

/** @param {NamedMaterial} material @returns {[string, string]} its value and text in a list of choices */
export function choiceOf({ name, wood }) {
  return [name, wood ? `${name} (wood, by its grain)` : name];
}

/** @param {NamedMaterial} material @returns {HTMLOptionElement} of a list of choices */
export function optionOf(material) {
  const [value, text] = choiceOf(material);
  return make("option", { value, title: material.about }, text);
}

/**
 * Colours of regions: that of the material, unless an earlier one looks too much like it.
 *
 * @param {readonly Region[]} regions
 * @param {Materials} materials
 * @returns {Vector[]} sRGB, 0 to 1
 */
export function coloursOf(regions, materials) {
  /** @type {Vector[]} */
  const colours = [];
  for (const region of regions) colours.push(apart(materials.named(region.material)?.colour ?? NO_COLOUR, colours));
  return colours;
}
