/** The solid: how large it is, in which unit its mesh is, what points up, and whether it is a shell. */

import { ask } from "./chosen.js";
import { button, identifier, make, setText, setValue } from "./dom.js";
import { largest, lengths } from "./numbers.js";

/** @typedef {import("../types.js").State} State */
/** @typedef {import("../types.js").SolidState} SolidState */

const LOWEST_HEARD = 20; // [Hz]
/** Metres per unit, and its name. @type {[number, string][]} */
const UNITS = [
  [1, "metre"],
  [0.01, "centimetre"],
  [0.001, "millimetre"],
  [0.0254, "inch"],
];
/** @type {Record<string, string>} */
const PLURALS = { m: "metres", cm: "centimetres", mm: "millimetres", in: "inches" };
const AXES = ["z", "y", "x", "-z", "-y", "-x"];
const MILLIMETRE = 0.001;

/**
 * Makes the panel of the solid.
 *
 * @param {HTMLElement} element
 * @param {import("../main.js").Parts} parts
 */
export function makeSize(element, parts) {
  const { connection, state } = parts;
  /** Highest mode that is known [Hz], of the surface with this number. */
  let heard = { surface: -1, hertz: Infinity };

  /** @param {Record<string, unknown>} settings */
  const change = (settings) => void ask(parts, "change_settings", { settings });
  const size = make("p", { id: "solid-size" });
  const hints = make("div", { class: "size-hints", role: "status" });
  const unit = make("select", { id: identifier("unit"), onchange: () => change({ unit: Number(unit.value) }) });
  const up = make(
    "select",
    { id: identifier("up"), onchange: () => change({ up: up.value === "z" ? null : up.value }) },
    ...AXES.map((axis) => make("option", { value: axis }, axis)),
  );
  const wall = make("input", {
    type: "number",
    id: identifier("wall"),
    min: 0,
    step: "any",
    size: 6,
    placeholder: "none: it is full",
    onchange: () => setWall(wall.value.trim() === "" ? null : Number(wall.value) * MILLIMETRE),
  });
  const fields = make(
    "details",
    { class: "more" },
    make("summary", {}, "Unit, up axis, wall"),
    pair("Unit", unit),
    pair("Up axis", up),
    pair("Wall [mm]", wall),
    make(
      "p",
      { class: "hint" },
      "Unit and up axis are those of the mesh file: up becomes z. A wall follows the surface, open or closed, " +
        "in place of what it surrounds.",
    ),
  );
  const none = make("p", { class: "hint" }, "Open a solid first.");
  element.append(none, size, hints, fields);

  /** @param {number | null} metres */
  function setWall(metres) {
    change({ wall: metres, discretisation: metres === null ? "voxel" : "finite-cell" });
  }

  /** @param {SolidState} solid @returns {HTMLElement[]} */
  function doubts(solid) {
    const found = [];
    if (solid.units.length > 0) {
      const silent = heard.surface === solid.surface && heard.hertz < LOWEST_HEARD;
      const heardOf = silent ? ", all its modes are below hearing" : "";
      const says = `It is ${lengths([solid.longest_side_m])} long${heardOf}. Or is its mesh in`;
      const buttons = solid.units.map(({ name, metres, longest_m }) =>
        button(`${PLURALS[name] ?? name}? (${lengths([longest_m])})`, () => change({ unit: metres })),
      );
      found.push(hint("unit", says, buttons));
    }
    const axis = solid.up;
    if (axis !== null) {
      const turn = button("Turn it upright", () => change({ up: axis }));
      found.push(hint("up", `It seems to lie on its side: in its mesh, ${axis} points up.`, [turn]));
    }
    const thickness = solid.shell_m;
    if (thickness !== null) {
      const shell = button(`Make it a shell of ${lengths([thickness])}`, () => setWall(thickness));
      found.push(hint("shell", "Its surface is open: what it surrounds was filled and is a full solid.", [shell]));
    }
    return found;
  }

  let shown = "";
  /** @param {State} now */
  function show(now) {
    const { solid, settings } = now;
    none.hidden = solid !== null;
    size.hidden = fields.hidden = hints.hidden = solid === null;
    if (!solid) return;
    setText(size, `${solid.name}: ${solid.extents_m ? lengths(solid.extents_m) : "its size is on its way \u2026"}`);
    const metres = Number(settings.unit ?? 1);
    const known = UNITS.some(([each]) => each === metres);
    unit.replaceChildren(
      ...UNITS.map(([each, name]) => make("option", { value: String(each) }, name)),
      ...(known ? [] : [make("option", { value: String(metres) }, `length of ${metres} m`)]),
    );
    unit.value = String(metres);
    up.value = settings.up ?? "z";
    setValue(wall, settings.wall ? String(Number((settings.wall / MILLIMETRE).toPrecision(6))) : "");
    // Buttons stay the same elements while nothing else is asked, for the sake of the focus.
    const asked = JSON.stringify([solid.surface, solid.units, solid.up, solid.shell_m, heard]);
    if (asked === shown) return;
    shown = asked;
    hints.replaceChildren(...doubts(solid));
  }

  state.onChange(show);
  connection.onBinary("bank", (header, arrays) => {
    heard = { surface: header.surface, hertz: largest(/** @type {Float64Array} */ (arrays.hertz)) };
    if (state.current) show(state.current);
  });
}

/** @param {string} label @param {HTMLInputElement | HTMLSelectElement} field */
function pair(label, field) {
  return make("div", { class: "pair" }, make("label", { for: field.id }, label), field);
}

/** @param {string} about @param {string} says @param {HTMLElement[]} buttons */
function hint(about, says, buttons) {
  return make(
    "div",
    { class: "size-hint", "data-about": about },
    make("p", {}, says),
    make("div", { class: "row" }, ...buttons),
  );
}
