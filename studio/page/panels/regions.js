/** Regions: what the solid is made of and where, in a table, and the form of the selected one. */

import { styleOf } from "../solid/palette.js";
import { button, find, keepList, make, setText } from "./dom.js";
import { coloursOf, constantsOf, optionOf } from "./materials.js";
import { makeRegionForm } from "./region-form.js";
import { makeRows, placeOf } from "./rows.js";
import { written } from "./values.js";

/** @typedef {import("../types.js").Region} Region */

/**
 * A line of the table: a region, or what is wrong with it.
 *
 * @typedef {{region: Region, number: number, fault: string | null}} Line
 */

const COLUMNS = 6;

/**
 * Makes the table of regions and the form of the selected one.
 *
 * @param {HTMLElement} element
 * @param {import("../main.js").Parts} parts
 */
export function makeRegions(element, parts) {
  const { state, selection, materials } = parts;
  const rows = makeRows(parts, "regions", show);
  const none = make(
    "p",
    { class: "hint" },
    "All of the solid is of one material, that of the settings. Add a region to make it of steel, glass or wood, and more regions for several: iron with a handle of beech.",
  );
  const lines = make("tbody");
  const table = make(
    "table",
    { class: "figures region-table" },
    make("caption", { class: "hidden" }, "Regions of the solid; of several in one place the last one counts"),
    make(
      "thead",
      {},
      make(
        "tr",
        {},
        make("th", { scope: "col" }, "Region"),
        make("th", { scope: "col" }, "Material"),
        heading("E", "GPa", "Young's modulus; of wood, along the grain"),
        heading("\u03bd", "", "Poisson's ratio"),
        heading("\u03c1", "kg/m\u00b3", "Density"),
        heading("\u03b7", "", "Loss factor at 1 kHz"),
      ),
    ),
    lines,
  );
  const add = button("Add a region", () => void addRegion(), { class: "main" });
  const preset = make("select", { id: "region-preset" });
  const said = make("p", { class: "field-error", role: "status", hidden: true });
  const form = makeRegionForm(parts, rows);
  const frame = make("div", { class: "scroll" }, table);
  element.append(none, frame, make("div", { class: "row" }, add, make("label", { for: "region-preset" }, "made of"), preset), said, form.element);

  async function addRegion() {
    const regions = state.current?.regions ?? [];
    const material = preset.value;
    // The first one is all of the solid, those after it are painted over it.
    if (regions.length === 0) {
      await rows.addRow({ name: "body", material });
    } else if (await rows.addRow({ name: freeName(regions), material, painted: [] })) {
      selection.set({ tool: "paint", erasing: false, colouring: "regions" });
    }
  }

  /** @param {Line} line */
  function create(line) {
    if (line.fault !== null) {
      return make("tr", {}, make("td", { colspan: COLUMNS, class: "row-fault" }, line.fault));
    }
    const radio = make("input", {
      type: "radio",
      name: "region",
      value: line.number,
      onchange: () => rows.choose(Number(radio.value)),
    });
    const name = make("label", { class: "region-name" }, radio, make("span", { class: "chip" }), make("span", { class: "name" }));
    return make(
      "tr",
      { onclick: () => rows.choose(Number(radio.value)) },
      make("th", { scope: "row" }, name, make("small", { class: "place" })),
      make("td", { class: "material" }),
      ...["young", "poisson", "density", "loss"].map((key) => make("td", { class: `number ${key}` })),
    );
  }

  /** @param {HTMLElement} row @param {Line} line */
  function update(row, line) {
    if (line.fault !== null) {
      setText(find(row, "td", HTMLElement), line.fault);
      return;
    }
    const { region, number } = line;
    const isChosen = rows.chosen() === number;
    const material = materials.named(region.material);
    const { young, poisson, density, loss, wood } = constantsOf(region, material);
    find(row, "input", HTMLInputElement).checked = isChosen;
    row.classList.toggle("chosen", isChosen);
    find(row, ".chip", HTMLElement).style.background = styleOf(colours()[number]);
    /** @type {[string, string][]} */
    const texts = [
      [".name", region.name],
      [".place", placeOf(region) ?? otherPlace(region)],
      [".material", region.material ?? (wood ? "own wood" : "own")],
      [".young", short(young / 1e9)],
      [".poisson", poisson === null ? "wood" : short(poisson)],
      [".density", short(density)],
      [".loss", loss === null ? "\u2013" : written(Number(loss.toPrecision(2)))],
    ];
    for (const [selector, text] of texts) setText(find(row, selector, HTMLElement), text);
  }

  const colours = () => coloursOf(state.current?.regions ?? [], materials);

  function show() {
    const regions = state.current?.regions ?? [];
    const isReady = (state.current?.solid?.surface ?? null) !== null;
    none.hidden = regions.length > 0;
    frame.hidden = regions.length === 0;
    add.disabled = !isReady || materials.all.length === 0;
    // The sentence about a first region that was refused has no row to stand at.
    const refused = regions.length === 0 ? rows.faultOf(0) : null;
    said.hidden = refused === null;
    setText(said, refused ?? "");
    /** @type {Line[]} */
    const all = regions.flatMap((region, number) => {
      const fault = rows.faultOf(number);
      /** @type {Line} */
      const own = { region, number, fault: null };
      return fault === null ? [own] : [own, { region, number, fault }];
    });
    keepList(lines, all, (line) => `${line.number}${line.fault === null ? "" : " fault"}`, create, update);
    form.show();
  }

  materials.onLoad(() => {
    preset.replaceChildren(...materials.all.map(optionOf));
    show();
  });
  state.onChange(show);
  selection.onChange(show);
}

/** @param {Region} region @returns {string} where it is, if it is neither painted nor has an expression */
function otherPlace(region) {
  if (region.box) return "in a box";
  if (region.mesh) return `inside ${region.part ?? "all"} of ${region.mesh}`;
  if (region.part) return `part ${region.part}`;
  if (region.labels) return `label ${region.label} of ${region.labels}`;
  return "all that is left";
}

/** @param {readonly Region[]} regions @returns {string} a name that none of them has */
function freeName(regions) {
  const names = new Set(regions.map(({ name }) => name));
  let number = regions.length + 1;
  while (names.has(`region ${number}`)) number += 1;
  return `region ${number}`;
}

/** @param {number} value */
function short(value) {
  return String(Number(value.toPrecision(3)));
}

/** @param {string} text @param {string} unit @param {string} title */
function heading(text, unit, title) {
  return make("th", { scope: "col", class: "number", title }, text, make("br"), make("small", {}, unit));
}
