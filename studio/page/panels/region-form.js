/** The form of the selected region: what it is made of, and where it is. */

import { button, make, setText } from "./dom.js";
import { choiceOf, constantsOf } from "./materials.js";
import { choiceField, numberField, textField, vectorField } from "./row-fields.js";
import { makePaintControls, placedBy } from "./rows.js";

/** @typedef {import("../types.js").Region} Region */
/** @typedef {"all" | "painted" | "where" | "box" | "part" | "mesh" | "labels"} Place */

/** @type {[Place, string][]} */
const PLACES = [
  ["all", "all that is left"],
  ["painted", "painted on the surface"],
  ["where", "where an expression holds"],
  ["box", "in a box"],
  ["part", "a named part of the mesh"],
  ["mesh", "inside another mesh"],
];
/** What a region without constants of its own has of its material. */
const OF_THE_MATERIAL = { young: null, poisson: null, density: null, loss_factor: null };
const AXES = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] };

/**
 * @param {import("../main.js").Parts} parts
 * @param {import("./rows.js").Rows} rows
 */
export function makeRegionForm(parts, rows) {
  const { state, selection, materials, connection } = parts;
  /** A place that was chosen and is not given yet, and of which row. @type {{number: number, place: Place} | null} */
  let wanted = null;

  /** @param {string} key */
  const keyed = (key) => ({
    take: (/** @type {unknown} */ value) => void rows.change({ [key]: value }),
    complain: (/** @type {string} */ sentence) => rows.complain(rows.chosen() ?? 0, sentence),
  });
  const name = textField("Name", keyed("name"), { maxlength: 100 });
  const material = choiceField("Material", [["", "of its own"]], {
    ...keyed("material"),
    take: (value) => void rows.change(value ? { ...OF_THE_MATERIAL, material: value } : ownConstants()),
  });
  const about = make("p", { class: "hint" });
  const young = numberField("E", "GPa", 1e9, keyed("young"));
  const poisson = numberField("\u03bd", "", 1, keyed("poisson"));
  const density = numberField("Density", "kg/m\u00b3", 1, keyed("density"));
  const loss = numberField("Loss factor", "at 1 kHz", 1, keyed("loss_factor"));
  const grain = vectorField("Grain", "", keyed("grain"));
  const along = make(
    "div",
    { class: "row", role: "group", "aria-label": "Grain along an axis" },
    ...Object.entries(AXES).map(([axis, direction]) =>
      button(`along ${axis}`, () => void rows.change({ grain: direction }), { class: "small" }),
    ),
  );
  grain.element.append(make("span"), along);
  const place = choiceField("Where", PLACES, { ...keyed(""), take: choosePlace });
  const expressed = {
    ...keyed(""),
    take: (/** @type {string | null} */ value) => value && void rows.change(placedBy("regions", { where: value })),
  };
  const where = textField("Expression", expressed, { placeholder: "x > 0.1 and z < 0.02", maxlength: 1000 });
  const part = textField("Part", {
    ...keyed(""),
    take: (value) => value && void rows.change(placedBy("regions", { part: value })),
  });
  const low = vectorField("From", "m", { ...keyed(""), take: (value) => changeBox(0, value) });
  const high = vectorField("To", "m", { ...keyed(""), take: (value) => changeBox(1, value) });
  const file = make("input", {
    type: "file",
    class: "hidden",
    accept: ".glb,.gltf,.obj,.off,.ply,.stl",
    tabindex: -1,
    "aria-hidden": "true",
    onchange: upload,
  });
  const mesh = make("p", { class: "hint" });
  const meshRow = make("div", { class: "row" }, button("Choose a mesh \u2026", () => file.click()), file, mesh);
  const depth = numberField("Depth", "mm", 1e-3, keyed("depth"));
  const brush = makePaintControls(parts, rows);
  const up = button("Up", () => rows.move(-1), { title: "Regions below this one then lie over it" });
  const down = button("Down", () => rows.move(1), { title: "It then lies over the one below" });
  const remove = button("Remove", () => rows.remove());
  const element = make(
    "div",
    { class: "row-form", role: "group", "aria-label": "The selected region" },
    name.element,
    material.element,
    about,
    make("div", { class: "twos" }, young.element, poisson.element, density.element, loss.element),
    grain.element,
    place.element,
    where.element,
    part.element,
    low.element,
    high.element,
    meshRow,
    brush.element,
    depth.element,
    make("div", { class: "row" }, up, down, remove),
  );

  /** @returns {Region | undefined} */
  function chosen() {
    const number = rows.chosen();
    return number === null ? undefined : state.current?.regions[number];
  }

  /** @returns {Record<string, unknown>} changes after which the region has its constants without a name */
  function ownConstants() {
    const region = chosen();
    if (!region) return {};
    const { young, poisson, density, loss } = constantsOf(region, materials.named(region.material));
    return { material: null, young, poisson, density, loss_factor: loss };
  }

  /** @param {Place} chosenPlace */
  async function choosePlace(chosenPlace) {
    const number = rows.chosen();
    if (number === null) return;
    wanted = { number, place: chosenPlace };
    show();
    if (chosenPlace === "all") await rows.change(placedBy("regions", {}));
    else if (chosenPlace === "box") await rows.change(placedBy("regions", { box: parts.view?.bounds() ?? null }));
    else if (chosenPlace === "painted" && (await rows.change(placedBy("regions", { painted: [] })))) {
      selection.set({ tool: "paint", erasing: false, colouring: "regions" });
    }
  }

  /** @param {number} corner @param {number[] | null} value */
  function changeBox(corner, value) {
    const box = chosen()?.box;
    if (!box || !value) return;
    void rows.change({ box: box.map((each, i) => (i === corner ? value : each)) });
  }

  async function upload() {
    const picked = file.files?.[0];
    file.value = "";
    if (!picked) return;
    try {
      const identifier = await connection.upload("mesh", picked.name, picked);
      await rows.change(placedBy("regions", { mesh: identifier }));
    } catch (error) {
      rows.complain(rows.chosen() ?? 0, error instanceof Error ? error.message : String(error));
    }
  }

  /** @param {Region} region @returns {Place} */
  function placeNow(region) {
    const isTyped = wanted?.place === "where" || wanted?.place === "mesh" || wanted?.place === "part";
    if (wanted && isTyped && wanted.number === rows.chosen()) return wanted.place;
    if (region.dabs !== null) return "painted";
    const keys = /** @type {const} */ (["where", "box", "mesh", "labels", "part"]);
    return keys.find((key) => region[key] !== undefined) ?? "all";
  }

  function show() {
    const region = chosen();
    const number = rows.chosen();
    element.hidden = !region;
    if (wanted && (wanted.number !== number || (region && region[/** @type {"where" | "mesh" | "part"} */ (wanted.place)]))) {
      wanted = null;
    }
    if (!region || number === null) return;
    const named = materials.named(region.material);
    const constants = constantsOf(region, named);
    // What holds where a field is empty.
    const usual = constantsOf({ name: "", dabs: null, fault: null, material: region.material }, named);
    name.show(region.name);
    material.show(region.material);
    setText(about, named ? named.about : "");
    about.hidden = !named;
    young.show(region.young, String(Number((usual.young / 1e9).toPrecision(3))));
    poisson.show(region.poisson, usual.poisson === null ? "wood" : String(usual.poisson));
    density.show(region.density, String(usual.density));
    loss.show(region.loss_factor, usual.loss === null ? "" : String(usual.loss));
    grain.element.hidden = !constants.wood;
    grain.show(region.grain ?? [1, 0, 0]);
    const now = placeNow(region);
    // Labels of a file are chosen in the project alone.
    place.offer(region.labels ? [...PLACES, ["labels", `label ${region.label} of ${region.labels}`]] : PLACES);
    place.show(now);
    part.element.hidden = now !== "part";
    part.show(region.part);
    where.element.hidden = now !== "where";
    where.show(region.where);
    low.element.hidden = high.element.hidden = now !== "box" || !region.box;
    low.show(region.box?.[0]);
    high.show(region.box?.[1]);
    meshRow.hidden = now !== "mesh";
    setText(mesh, region.mesh ?? "");
    depth.element.hidden = now !== "painted";
    depth.show(region.depth, "through");
    brush.show(now === "painted" ? region : undefined);
    up.disabled = number === 0;
    down.disabled = number + 1 >= (state.current?.regions.length ?? 0);
  }

  materials.onLoad(() => {
    material.offer([["", "of its own"], ...materials.all.map(choiceOf)]);
    show();
  });
  return { element, show };
}
