/**
 * The solid on the page: what the server says of it becomes the view, what is done to it becomes strikes
 * and calls.
 */

import { Color } from "three";
import { Brush, dabAt } from "./brush.js";
import { makeChooser, makeUnitDialog } from "./chooser.js";
import { span } from "./colours.js";
import { Composition } from "./composition.js";
import { acceptDrops } from "./files.js";
import { Gestures } from "./gestures.js";
import { makeLegend } from "./legend.js";
import { Marks } from "./marks.js";
import { makeNotices } from "./notices.js";
import { Symbols } from "./symbols.js";
import { makeSounding } from "./sounding.js";
import { makeToolbar } from "./toolbar.js";
import { View } from "./view.js";

/** @typedef {import("../main.js").Parts} Parts */

const HELP =
  "The solid in 3D. Arrow keys turn it, Shift and arrow keys shift it, plus and minus zoom, " +
  "blank strikes it in the middle of the view, Enter strikes the selected target.";
const LOST = "The browser took the graphics away; the solid is back as soon as it gives them again.";
const NO_BANK = "The solid's modes are not there yet: strike again in a moment.";

export class Solid {
  /**
   * @param {HTMLElement} element
   * @param {Parts} parts
   */
  constructor(element, parts) {
    this.parts = parts;
    this.element = element;
    /** Number of the surface that is shown. @type {number | null} */
    this.shown = null;
    /** Number of the surface that is wanted. @type {number | null} */
    this.wanted = null;
    /** @type {{surface: number, young: Float32Array} | null} */
    this.material = null;
    /** @param {string} className @param {string} [tag] @returns {HTMLElement} */
    const layer = (className, tag = "div") => {
      const made = document.createElement(tag);
      made.className = className;
      element.append(made);
      return made;
    };
    const crosshair = layer("crosshair");
    crosshair.ariaHidden = "true";
    const labels = layer("marks");
    const gauge = layer("gauge");
    gauge.hidden = true;
    gauge.ariaHidden = "true";
    const bottom = layer("stage-bottom");
    this.legend = makeLegend(bottom.appendChild(document.createElement("div")));
    makeSounding(bottom.appendChild(document.createElement("div")), parts);
    const toolbar = layer("stage-toolbar");
    this.hint = layer("stage-hint");
    this.notices = makeNotices(layer("notices"), parts, () => this.#silent);
    this.openChooser = makeChooser(element, parts);
    const askUnit = makeUnitDialog(element, parts);

    /** @type {[number, number] | null} */
    this.spanned = null;
    /** @type {View | null} */
    this.drawing = null;
    /** @type {Marks | null} */
    this.marks = null;
    /** @type {Gestures | null} */
    this.gestures = null;
    /** @type {Brush | null} */
    this.brush = null;
    /** @type {Symbols | null} */
    this.symbols = null;
    this.composition = new Composition(parts, () => this.#paint());
    try {
      this.drawing = new View(element);
    } catch (error) {
      this.notices.graphics(/** @type {Error} */ (error).message);
    }
    if (this.drawing) {
      const { drawing } = this;
      drawing.margins = () => [toolbar.offsetHeight, bottom.offsetHeight];
      const margins = new ResizeObserver(() => drawing.resize());
      for (const part of [toolbar, bottom]) margins.observe(part);
      this.#prepare(drawing, labels, gauge, toolbar);
    }
    acceptDrops(
      parts,
      element,
      (x, y) => this.pick(x, y),
      (vertex) => this.marks?.showGhost(vertex),
      askUnit,
    );
    this.#keys();
    parts.state.onChange((now) => {
      if (this.wanted !== (now.solid?.surface ?? null)) this.#fetch(now.solid?.surface ?? null);
      element.dataset.solid = now.solid === null ? "none" : now.solid.surface === null ? "awaited" : "shown";
      this.#mark();
      this.#paint();
    });
    parts.selection.onChange((now, before) => {
      this.#mark();
      if (now.colouring !== before.colouring || now.row !== before.row) this.#paint();
    });
    parts.connection.onBinary("bank", (header, arrays) => {
      this.material = { surface: header.surface, young: /** @type {Float32Array} */ (arrays.young) };
      this.#paint();
      this.notices.show();
    });
  }

  /**
   * @param {View} view
   * @param {HTMLElement} labels
   * @param {HTMLElement} gauge
   * @param {HTMLElement} toolbar
   */
  #prepare(view, labels, gauge, toolbar) {
    const { parts } = this;
    const marks = new Marks(view, labels, (name) => parts.selection.set({ target: name }));
    this.marks = marks;
    this.brush = new Brush(view);
    const symbols = new Symbols(view, parts);
    this.symbols = symbols;
    view.canvas.setAttribute("role", "application");
    view.canvas.setAttribute("aria-label", HELP);
    view.onLost = (lost) => this.notices.graphics(lost ? LOST : null);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      marks.takeColours();
      symbols.takeColours();
      this.#paint();
    });
    makeToolbar(toolbar, parts, view);
    this.gestures = new Gestures(view, marks, parts.selection, gauge, {
      strike: (vertex, strength) => this.strike(vertex, strength),
      place: (vertex) => this.#place(vertex),
      painting: {
        brush: this.brush,
        radius: () => this.#radius,
        dab: (dab, vertex) => this.#dab(dab, vertex),
        paint: (dabs) => this.#takeStroke(dabs),
        point: (point) => this.#hold(point),
      },
      choose: (name) => parts.selection.set({ target: name }),
      hover: (vertex) =>
        this.legend.point(vertex === null || !this.#painted ? null : (this.material?.young[vertex] ?? null)),
    });
  }

  #keys() {
    const { keys, selection } = this.parts;
    const digits = Array.from("123456789");
    keys.add(digits, "Strike the last point again, with a strength of 1/9 to 9/9", ({ key }) => {
      if (selection.current.vertex === null) return false;
      this.strike(selection.current.vertex, Number(key) / 9);
    });
    keys.add("Enter", "Strike the selected target", () => {
      const name = selection.current.target;
      return name === null ? false : this.strikeTarget(name);
    });
    // The canvas takes these itself when it is focused; they are here for the list.
    const elsewhere = () => false;
    keys.add(["ArrowLeft", "ArrowUp", "ArrowRight", "ArrowDown"], "In the view: turn the solid", elsewhere);
    keys.add(["Shift+ArrowLeft", "Shift+ArrowUp"], "In the view: shift it", elsewhere);
    keys.add(["+", "-"], "In the view: nearer, farther", elsewhere);
    keys.add("Home", "In the view: as it was seen first", elsewhere);
    keys.add(" ", "In the view: strike it, place a target, or paint, under the cross", elsewhere);
    keys.add("Escape", "No target selected; back to striking", () => {
      if (this.gestures?.cancel()) return;
      if (selection.current.tool === "strike" && selection.current.target === null) return false;
      if (selection.current.tool === "paint" || selection.current.tool === "point") {
        selection.set({ tool: "strike", pending: null });
        return;
      }
      selection.set(selection.current.tool === "place" && selection.current.target !== null
        ? { target: null }
        : { tool: "strike", target: null });
    });
  }

  /**
   * Strikes a vertex of the solid along its inward normal, and is heard at once.
   *
   * @param {number} vertex
   * @param {number} [strength] 0 to 1, that of the toolbar where there is none
   */
  strike(vertex, strength = this.parts.selection.current.strength) {
    const { bank, selection, say } = this.parts;
    if (this.#silent) {
      say(NO_BANK);
      return;
    }
    bank.strike(vertex, strength);
    selection.set({ vertex });
    this.drawing?.wave(vertex, strength);
  }

  /**
   * Strikes where a target is.
   *
   * @param {string} name
   * @param {number} [strength]
   * @returns {boolean} whether there is such a target
   */
  strikeTarget(name, strength) {
    const target = this.parts.state.current?.targets.find((one) => one.name === name);
    if (target) this.strike(target.vertex, strength);
    return target !== undefined;
  }

  /**
   * @param {number} vertex
   * @returns {{x: number, y: number, hidden: boolean} | null} pixels of the page
   */
  project(vertex) {
    return this.drawing?.project(vertex) ?? null;
  }

  /** @param {number} x pixels of the page @param {number} y @returns {number | null} the vertex there */
  pick(x, y) {
    return this.drawing?.pick(x, y)?.vertex ?? null;
  }

  /** @returns {boolean} whether the solid and its material are as the server told them last */
  get settled() {
    return this.shown !== null && this.shown === this.wanted && this.#painted && (this.drawing?.drawings ?? 0) > 0;
  }

  /** @returns {boolean} whether the modes of the solid are not there yet */
  get #silent() {
    return this.material === null || this.material.surface !== this.wanted;
  }

  /** @returns {boolean} whether the material is that of the surface that is shown */
  get #painted() {
    return this.material !== null && this.material.surface === this.shown;
  }

  /** @param {number | null} number of the surface that the server has now */
  async #fetch(number) {
    this.wanted = number;
    if (!this.drawing) return;
    if (number === null) {
      this.drawing.clear();
      this.shown = null;
      this.parts.selection.set({ vertex: null });
      this.legend.show(null);
      return;
    }
    try {
      const { arrays } = await this.parts.connection.binary(`/surface/${number}`);
      if (this.wanted !== number) return; // another one is on its way
      this.drawing.setSurface(
        /** @type {Float32Array} */ (arrays.positions),
        /** @type {Uint32Array} */ (arrays.triangles),
      );
      this.marks?.setInward(/** @type {Float32Array} */ (arrays.inward));
      if (this.brush) this.brush.inward = /** @type {Float32Array} */ (arrays.inward);
      // Its vertices have other numbers.
      if (this.shown !== null) this.parts.selection.set({ vertex: null });
      this.shown = number;
      this.spanned = null;
      this.#paint();
      this.#mark();
    } catch (error) {
      if (this.wanted === number) this.wanted = null; // the next state asks again
      this.parts.say(/** @type {Error} */ (error).message, "error");
    }
  }

  /** Shows the material as colours, or none where there is none yet. */
  #paint() {
    const surface = this.drawing?.surface;
    if (!surface) return;
    const composition = this.composition.of(surface);
    surface.hatch(this.composition.hatching(surface));
    this.symbols?.show(this.marks?.inward ?? null, composition);
    const bare = new Color(getComputedStyle(this.element).getPropertyValue("--bare").trim());
    if (composition && this.parts.selection.current.colouring === "regions") {
      surface.paintRegions(composition.region, this.composition.colours(), bare);
      this.legend.list(this.composition.legend());
      this.drawing?.invalidate();
      return;
    }
    if (this.#painted && this.material) {
      this.spanned = span(this.material.young, this.spanned);
      surface.paint(this.material.young, this.spanned);
    } else {
      surface.paintBare(bare);
    }
    this.legend.show(this.#painted ? this.spanned : null);
    this.drawing?.invalidate();
  }

  /** @returns {[number[], number[]] | null} lowest and highest corner of the solid [m] */
  bounds() {
    const geometry = this.drawing?.surface?.geometry;
    if (!geometry) return null;
    geometry.computeBoundingBox();
    const box = /** @type {import("three").Box3} */ (geometry.boundingBox);
    const short = (/** @type {number} */ value) => Number(value.toPrecision(5));
    return [box.min.toArray().map(short), box.max.toArray().map(short)];
  }

  /** @returns {number} radius of the brush [m], negative if it takes paint away */
  get #radius() {
    const { brush, erasing } = this.parts.selection.current;
    return (erasing ? -brush : brush) * (this.parts.state.current?.solid?.longest_side_m ?? 0);
  }

  /** Shows a place that was painted. @param {import("./composition.js").Dab} dab @param {number} vertex nearest to it */
  #dab(dab, vertex) {
    const { row } = this.parts.selection.current;
    const surface = this.drawing?.surface;
    const inward = this.marks?.inward;
    if (!row || !surface || !inward) return;
    const normal = inward.subarray(3 * vertex, 3 * vertex + 3);
    this.composition.preview(surface, row.kind, row.number, dab, { inward, normal });
  }

  /** @param {import("./composition.js").Dab[]} dabs of a stroke; none if it was given up */
  #takeStroke(dabs) {
    const { connection, selection, say } = this.parts;
    const { row } = selection.current;
    if (dabs.length === 0 || !row) {
      this.composition.fetchAgain();
      return;
    }
    connection.call("paint", { kind: row.kind, number: row.number, dabs }).catch((error) => {
      this.composition.fetchAgain();
      say(error.message, "error");
    });
  }

  /** Places the selected support. @param {import("three").Vector3} point */
  #hold(point) {
    const { connection, selection, say } = this.parts;
    const { row, pending } = selection.current;
    if (!row) return;
    const at = dabAt(point, 0).slice(0, 3);
    const changes = { ...pending, at, where: null, painted: null };
    connection.call("change_row", { kind: row.kind, number: row.number, changes }).then(
      () => selection.set({ tool: "strike", pending: null }),
      (error) => say(error.message, "error"),
    );
  }

  /** Shows targets, and says what a click does where something is placed or painted. */
  #mark() {
    const { state, selection } = this.parts;
    const { target, tool } = selection.current;
    this.marks?.show(this.shown === this.wanted ? (state.current?.targets ?? []) : [], target);
    this.hint.hidden = tool === "strike" || !this.drawing;
    if (this.hint.hidden) return;
    if (tool !== "place") {
      this.hint.replaceChildren(this.#paintHint());
      return;
    }
    const says = target === null ? "Press on the solid: a target is added." : `Press on the solid: ${target} moves there.`;
    const another = document.createElement("button");
    another.type = "button";
    another.textContent = "Add another";
    another.onclick = () => selection.set({ target: null });
    this.hint.replaceChildren(says, ...(target === null ? [] : [another]));
  }

  /** @returns {string} what a press does with the selected row */
  #paintHint() {
    const { row, tool, erasing } = this.parts.selection.current;
    if (tool === "point") return "Press on the solid: the support is placed there.";
    const name = row?.kind === "regions" ? this.parts.state.current?.regions[row.number]?.name : "the support";
    return erasing ? `Draw over the solid: paint of ${name} is taken away.` : `Draw over the solid: ${name} is painted.`;
  }

  /** @param {number} vertex where a target is added, or the selected one moved */
  #place(vertex) {
    const { connection, selection, say } = this.parts;
    const { target } = selection.current;
    const done =
      target === null
        ? connection.call("add_target", { vertex })
        : connection.call("change_target", { target, vertex });
    done.catch((error) => say(error.message, "error"));
  }
}

/**
 * @param {HTMLElement} element
 * @param {Parts} parts
 * @returns {Solid}
 */
export function makeSolid(element, parts) {
  return new Solid(element, parts);
}
