/** Supports: where the solid is held, springy, on pads or carries masses. */

import { button, find, keepList, make, setText } from "./dom.js";
import { choiceField, numberField, textField, vectorField } from "./row-fields.js";
import { makePaintControls, makeRows, placedBy, placeOf } from "./rows.js";

/** @typedef {import("../types.js").Support} Support */
/** @typedef {"held" | "spring" | "pad" | "mass"} What */
/** @typedef {"painted" | "at" | "where" | "region"} Place */

/** @type {[What, string][]} */
const WHATS = [
  ["held", "held"],
  ["spring", "springs"],
  ["pad", "a pad"],
  ["mass", "a mass"],
];
/** @type {[Place, string][]} */
const PLACES = [
  ["painted", "painted on the surface"],
  ["at", "a point, or a ball about it"],
  ["where", "where an expression holds"],
  ["region", "a region"],
];
const AXES = ["x", "y", "z"];
const NOTHING = { spring: null, pad: null, thickness: null, mass: null };
/** What a support begins with when it becomes another one. @type {Record<What, Record<string, unknown>>} */
const FIRST = {
  held: NOTHING,
  spring: { ...NOTHING, spring: 1e6 },
  pad: { ...NOTHING, pad: "rubber", thickness: 0.005 },
  mass: { ...NOTHING, mass: 0.01, radius: null },
};

/**
 * Makes the list of supports and the form of the selected one.
 *
 * @param {HTMLElement} element
 * @param {import("../main.js").Parts} parts
 */
export function makeSupports(element, parts) {
  const { state, selection, materials } = parts;
  const rows = makeRows(parts, "supports", show);
  const none = make("p", { class: "hint" }, "The solid is free, as if it hung from a thread.");
  const list = make("ul", { class: "target-list support-list" });
  const add = button("Paint what is held", () => void addPainted(), { class: "main" });
  const point = button("Hold a point", () => void addPoint());
  const said = make("p", { class: "field-error", role: "status", hidden: true });
  const form = makeForm(parts, rows);
  element.append(none, list, make("div", { class: "row" }, add, point), said, form.element);

  async function addPainted() {
    if (await rows.addRow({ painted: [] })) selection.set({ tool: "paint", erasing: false, colouring: "regions" });
  }

  async function addPoint() {
    if (await rows.addRow({ painted: [] })) selection.set({ tool: "point", pending: {}, colouring: "regions" });
  }

  /** @param {Support} _ */
  function create(_) {
    const radio = make("input", {
      type: "radio",
      name: "support",
      onchange: () => rows.choose(Number(radio.value)),
    });
    return make(
      "li",
      {},
      make("label", { class: "target" }, radio, make("span", { class: "target-name" }), make("span", { class: "target-clip" })),
      make("p", { class: "row-fault" }),
    );
  }

  /** @param {HTMLElement} row @param {Support} support @param {number} number */
  function update(row, support, number) {
    const isChosen = rows.chosen() === number;
    const radio = find(row, "input", HTMLInputElement);
    radio.value = String(number);
    radio.checked = isChosen;
    row.classList.toggle("chosen", isChosen);
    setText(find(row, ".target-name", HTMLElement), titleOf(support));
    setText(find(row, ".target-clip", HTMLElement), placeOf(support) ?? pointOf(support));
    const fault = find(row, ".row-fault", HTMLElement);
    setText(fault, rows.faultOf(number) ?? "");
    fault.hidden = fault.textContent === "";
  }

  function show() {
    const supports = state.current?.supports ?? [];
    const isReady = (state.current?.solid?.surface ?? null) !== null;
    none.hidden = supports.length > 0;
    add.disabled = point.disabled = !isReady;
    const refused = supports.length === 0 ? rows.faultOf(0) : null;
    said.hidden = refused === null;
    setText(said, refused ?? "");
    keepList(list, supports, (_, number) => String(number), create, update);
    form.show();
  }

  materials.onLoad(show);
  state.onChange(show);
  selection.onChange(show);
}

/**
 * @param {import("../main.js").Parts} parts
 * @param {import("./rows.js").Rows} rows
 */
function makeForm(parts, rows) {
  const { state, selection, materials } = parts;
  /** A place that was chosen and is not given yet. @type {{number: number, place: Place} | null} */
  let wanted = null;
  /** @param {string} key */
  const keyed = (key) => ({
    take: (/** @type {unknown} */ value) => void rows.change({ [key]: value }),
    complain: (/** @type {string} */ sentence) => rows.complain(rows.chosen() ?? 0, sentence),
  });
  const what = choiceField("What", WHATS, { ...keyed(""), take: chooseWhat });
  const spring = numberField("Stiffness", "N/m", 1, keyed("spring"));
  const pad = choiceField("Of", [], keyed("pad"));
  const thickness = numberField("Thickness", "mm", 1e-3, keyed("thickness"));
  const mass = numberField("Mass", "g", 1e-3, keyed("mass"));
  const boxes = AXES.map((axis) => make("input", { type: "checkbox", onchange: changeAxes, value: axis }));
  const along = make(
    "div",
    { class: "row", role: "group", "aria-label": "Axes along which it acts" },
    make("span", { class: "row-label" }, "Along"),
    ...boxes.map((box) => make("label", { class: "check" }, box, box.value)),
  );
  const place = choiceField("Where", PLACES, { ...keyed(""), take: choosePlace });
  const expressed = {
    ...keyed(""),
    take: (/** @type {string | null} */ value) => value && void rows.change(placedBy("supports", { where: value })),
  };
  const where = textField("Expression", expressed, { placeholder: "z < 0.01", maxlength: 1000 });
  const region = choiceField("Region", [], {
    ...keyed(""),
    take: (value) => void rows.change(placedBy("supports", { where: `region:${value}` })),
  });
  const at = vectorField("Point", "m", {
    ...keyed(""),
    take: (value) => void rows.change(value ? placedBy("supports", { at: value, radius: chosen()?.radius ?? null }) : { at: null }),
  });
  const pick = button("Press on the solid", () => selection.set({ tool: "point", pending: {} }));
  const radius = numberField("Radius", "mm", 1e-3, keyed("radius"));
  const brush = makePaintControls(parts, rows);
  const remove = button("Remove", () => rows.remove());
  const element = make(
    "div",
    { class: "row-form", role: "group", "aria-label": "The selected support" },
    what.element,
    spring.element,
    pad.element,
    thickness.element,
    mass.element,
    along,
    place.element,
    where.element,
    region.element,
    at.element,
    make("div", { class: "row" }, pick),
    radius.element,
    brush.element,
    make("div", { class: "row" }, remove),
  );

  /** @returns {Support | undefined} */
  function chosen() {
    const number = rows.chosen();
    return number === null ? undefined : state.current?.supports[number];
  }

  /** @param {What} kind */
  function chooseWhat(kind) {
    const support = chosen();
    if (!support) return;
    // A mass is at a point, which has to be pressed first.
    if (kind === "mass" && !support.at) selection.set({ tool: "point", pending: FIRST.mass });
    else void rows.change(FIRST[kind]);
  }

  /** @param {Place} chosenPlace */
  async function choosePlace(chosenPlace) {
    const number = rows.chosen();
    if (number === null) return;
    wanted = { number, place: chosenPlace };
    show();
    const first = state.current?.regions[0]?.name;
    if (chosenPlace === "at") selection.set({ tool: "point", pending: {} });
    if (chosenPlace === "region" && first) await rows.change(placedBy("supports", { where: `region:${first}` }));
    if (chosenPlace === "painted" && (await rows.change(placedBy("supports", { painted: [] })))) {
      selection.set({ tool: "paint", erasing: false, colouring: "regions" });
    }
  }

  function changeAxes() {
    const chosenAxes = boxes.filter((box) => box.checked).map((box) => box.value).join("");
    if (chosenAxes === "") show();
    else void rows.change({ along: chosenAxes });
  }

  /** @param {Support} support @returns {Place} */
  function placeNow(support) {
    if (wanted !== null && wanted.number === rows.chosen() && wanted.place !== "painted") return wanted.place;
    if (support.dabs !== null) return "painted";
    return support.at ? "at" : support.where?.startsWith("region:") ? "region" : "where";
  }

  function show() {
    const support = chosen();
    const number = rows.chosen();
    element.hidden = !support;
    if (wanted && (!support || wanted.number !== number || isPlaced(support, wanted.place))) wanted = null;
    if (!support) return;
    const kind = whatOf(support);
    const now = placeNow(support);
    const regions = state.current?.regions ?? [];
    what.show(kind);
    spring.element.hidden = kind !== "spring";
    spring.show(support.spring);
    const unit = spring.element.querySelector(".field-unit");
    if (unit) setText(unit, support.at && !support.radius ? "N/m" : "N/m\u00b3, by area");
    pad.element.hidden = thickness.element.hidden = kind !== "pad";
    pad.show(support.pad);
    thickness.show(support.thickness);
    mass.element.hidden = kind !== "mass";
    mass.show(support.mass);
    along.hidden = kind === "mass" || kind === "pad";
    for (const box of boxes) box.checked = (support.along ?? "xyz").includes(box.value);
    place.show(now);
    where.element.hidden = now !== "where";
    where.show(support.where);
    region.offer(regions.map(({ name }) => [name, name]));
    region.element.hidden = now !== "region";
    region.show(support.where?.slice("region:".length));
    at.element.hidden = pick.hidden = now !== "at";
    pick.setAttribute("aria-pressed", String(selection.current.tool === "point"));
    at.show(support.at);
    radius.element.hidden = now !== "at" || kind === "mass";
    radius.show(support.radius, kind === "pad" ? "" : "the point alone");
    brush.show(now === "painted" ? support : undefined);
  }

  materials.onLoad(() => {
    pad.offer(materials.all.map(({ name }) => [name, name]));
    show();
  });
  return { element, show };
}

/** @param {Support} support @returns {What} */
export function whatOf(support) {
  if (support.mass !== undefined) return "mass";
  return support.pad !== undefined ? "pad" : support.spring !== undefined ? "spring" : "held";
}

/** @param {Support} support @param {Place} place */
function isPlaced(support, place) {
  if (place === "painted") return support.dabs !== null;
  if (place === "at") return support.at !== undefined;
  return support.where !== undefined && support.where.startsWith("region:") === (place === "region");
}

/** @param {Support} support @returns {string} what a line of the list calls it */
function titleOf(support) {
  const only = (support.along ?? "xyz").length < 3 ? ` along ${[...(support.along ?? "")].join(", ")}` : "";
  const kinds = {
    held: `Held${only}`,
    spring: `Springs${only}`,
    pad: `Pad of ${support.pad}`,
    mass: `Mass of ${Number((1000 * (support.mass ?? 0)).toPrecision(3))} g`,
  };
  return kinds[whatOf(support)];
}

/** @param {Support} support @returns {string} */
function pointOf(support) {
  const shown = (support.at ?? []).map((value) => Number((1000 * value).toPrecision(3))).join(", ");
  return support.radius ? `ball about ${shown} mm` : `at ${shown} mm`;
}
