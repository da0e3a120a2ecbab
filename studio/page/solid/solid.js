/**
 * The solid on the page: what the server says of it becomes the view, what is done to it becomes strikes
 * and calls.
 */

import { Color } from "three";
import { makeChooser, makeUnitDialog } from "./chooser.js";
import { span } from "./colours.js";
import { acceptDrops } from "./files.js";
import { Gestures } from "./gestures.js";
import { makeLegend } from "./legend.js";
import { Marks } from "./marks.js";
import { makeNotices } from "./notices.js";
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
    });
    parts.selection.onChange(() => this.#mark());
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
    view.canvas.setAttribute("role", "application");
    view.canvas.setAttribute("aria-label", HELP);
    view.onLost = (lost) => this.notices.graphics(lost ? LOST : null);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      marks.takeColours();
      this.#paint();
    });
    makeToolbar(toolbar, parts, view);
    this.gestures = new Gestures(view, marks, parts.selection, gauge, {
      strike: (vertex, strength) => this.strike(vertex, strength),
      place: (vertex) => this.#place(vertex),
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
    keys.add(" ", "In the view: strike it, or place a target, under the cross", elsewhere);
    keys.add("Escape", "No target selected; back to striking", () => {
      if (this.gestures?.cancel()) return;
      if (selection.current.tool === "strike" && selection.current.target === null) return false;
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
    if (this.#painted && this.material) {
      this.spanned = span(this.material.young, this.spanned);
      surface.paint(this.material.young, this.spanned);
    } else {
      const bare = getComputedStyle(this.element).getPropertyValue("--bare").trim();
      surface.paintBare(new Color(bare));
    }
    this.legend.show(this.#painted ? this.spanned : null);
    this.drawing?.invalidate();
  }

  /** Shows targets, and says what a click does where one is placed. */
  #mark() {
    const { state, selection } = this.parts;
    const { target, tool } = selection.current;
    this.marks?.show(this.shown === this.wanted ? (state.current?.targets ?? []) : [], target);
    this.hint.hidden = tool !== "place" || !this.drawing;
    if (this.hint.hidden) return;
    const says = target === null ? "Press on the solid: a target is added." : `Press on the solid: ${target} moves there.`;
    const another = document.createElement("button");
    another.type = "button";
    another.textContent = "Add another";
    another.onclick = () => selection.set({ target: null });
    this.hint.replaceChildren(says, ...(target === null ? [] : [another]));
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
