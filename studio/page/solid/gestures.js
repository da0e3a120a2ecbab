/**
 * What the pointer and keys do on the solid: strike, place a target, choose one, paint, turn.
 *
 * A press on the solid strikes at once; one beside it, with the right button or with two fingers turns.
 */

import * as THREE from "three";

/** @typedef {import("./view.js").View} View */
/** @typedef {import("./marks.js").Marks} Marks */
/** @typedef {import("../state.js").Selection} Selection */

/**
 * @typedef {object} Deeds
 * @property {(vertex: number, strength: number) => void} strike
 * @property {(vertex: number) => void} place
 * @property {(name: string) => void} choose
 * @property {(vertex: number | null) => void} hover
 * @property {Painting} [painting] where regions and supports are edited
 */

/**
 * @typedef {object} Painting
 * @property {import("./brush.js").Brush} brush
 * @property {() => number} radius of the brush [m], negative if it takes paint away
 * @property {(dab: import("./composition.js").Dab, vertex: number) => void} dab a place of a stroke
 * @property {(dabs: import("./composition.js").Dab[]) => void} paint a stroke that has ended; none if it was given up
 * @property {(point: THREE.Vector3) => void} point where a support is placed
 */

// As long as this was pressed, a strike is as strong as it can be.
const FULL_SECONDS = 0.8;
const LEAST_STRENGTH = 0.05;
const TURN = Math.PI / 24;
const SHIFT_PIXELS = 24;
const NEARER = 1.15;

/** @type {Record<string, [number, number]>} */
const WAYS = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

/** @param {number} seconds pressed @returns {number} strength */
export function heldStrength(seconds) {
  return Math.min(1, LEAST_STRENGTH + ((1 - LEAST_STRENGTH) * seconds) / FULL_SECONDS);
}

export class Gestures {
  /**
   * @param {View} view
   * @param {Marks | null} marks
   * @param {Selection} selection
   * @param {HTMLElement} gauge shown while a strike's strength grows
   * @param {Deeds} deeds
   */
  constructor(view, marks, selection, gauge, deeds) {
    this.view = view;
    this.marks = marks;
    this.painting = deeds.painting;
    this.selection = selection;
    this.gauge = gauge;
    this.deeds = deeds;
    /** @type {{pointer: number, vertex: number, since: number} | null} */
    this.held = null;
    /** @type {{pointer: number, vertex: number | null} | null} */
    this.placing = null;
    this.frame = 0;
    const canvas = view.canvas;
    // Before the camera's own listeners, which ask whether they may turn.
    canvas.addEventListener("pointerdown", (event) => this.#down(event), { capture: true });
    canvas.addEventListener("pointermove", (event) => this.#move(event));
    canvas.addEventListener("pointerup", (event) => this.#up(event));
    canvas.addEventListener("pointercancel", () => this.#cancel());
    canvas.addEventListener("pointerleave", () => this.#leave());
    canvas.addEventListener("keydown", (event) => this.#key(event));
  }

  /** @returns {boolean} whether something was under way that now is not */
  cancel() {
    const busy = this.held !== null || this.placing !== null || this.#painting;
    this.#cancel();
    return busy;
  }

  /** @returns {boolean} whether a stroke goes on */
  get #painting() {
    return (this.painting?.brush.stroke ?? null) !== null;
  }

  /** @param {PointerEvent} event */
  #down(event) {
    if (this.held || this.placing || this.#painting) this.#cancel(); // a second finger: it turns, and nothing else
    this.view.letTurn(true);
    if (event.button !== 0 || !event.isPrimary) return;
    const picked = this.view.pick(event.clientX, event.clientY);
    const { tool, holding, strength } = this.selection.current;
    const mark = tool === "paint" || tool === "point" ? null : this.#mark(event);
    if (mark && mark.distance < (picked?.distance ?? Infinity)) {
      this.view.letTurn(false);
      this.deeds.choose(mark.name);
      return;
    }
    if (!picked) return;
    this.view.letTurn(false);
    if (tool === "paint") {
      this.#begin(event.clientX, event.clientY);
    } else if (tool === "point") {
      this.painting?.point(picked.point);
    } else if (tool === "place") {
      this.placing = { pointer: event.pointerId, vertex: picked.vertex };
      this.marks?.showGhost(picked.vertex);
    } else if (holding) {
      this.held = { pointer: event.pointerId, vertex: picked.vertex, since: performance.now() };
      this.#grow(event.clientX, event.clientY);
    } else {
      const pressed = event.pointerType === "pen" && event.pressure > 0 ? event.pressure : strength;
      this.deeds.strike(picked.vertex, pressed);
    }
  }

  /** @param {PointerEvent} event */
  #move(event) {
    if (event.buttons !== 0 && !this.placing && !this.#painting) return;
    if (this.frame) return;
    const { clientX, clientY } = event;
    this.frame = requestAnimationFrame(() => {
      this.frame = 0;
      this.#go(clientX, clientY);
      const picked = this.view.pick(clientX, clientY);
      this.painting?.brush.hover(this.selection.current.tool === "paint" ? picked : null, this.painting.radius());
      if (this.placing) {
        this.placing.vertex = picked?.vertex ?? null;
        this.marks?.showGhost(this.placing.vertex);
      } else if (this.selection.current.tool === "place") {
        this.marks?.showGhost(picked?.vertex ?? null);
      }
      this.view.canvas.dataset.under = picked ? this.selection.current.tool : "nothing";
      this.deeds.hover(picked?.vertex ?? null);
    });
  }

  /** @param {PointerEvent} event */
  #up(event) {
    const { held, placing } = this;
    if (this.#painting && event.isPrimary) {
      this.#go(event.clientX, event.clientY);
      this.#end();
    }
    if (held?.pointer === event.pointerId) {
      this.deeds.strike(held.vertex, heldStrength((performance.now() - held.since) / 1000));
      this.#cancel();
    }
    if (placing?.pointer === event.pointerId) {
      const picked = this.view.pick(event.clientX, event.clientY);
      this.#cancel();
      if (picked) this.deeds.place(picked.vertex);
    }
  }

  #cancel() {
    this.held = null;
    this.placing = null;
    // What was shown of a stroke that is given up goes with it.
    if (this.#painting) {
      this.painting?.brush.end();
      this.painting?.paint([]);
    }
    this.gauge.hidden = true;
    this.marks?.showGhost(null);
  }

  #leave() {
    this.deeds.hover(null);
    this.painting?.brush.hover(null, 0);
    if (!this.placing) this.marks?.showGhost(null);
  }

  /** @param {number} x @param {number} y pixels of the page */
  #grow(x, y) {
    const box = this.view.canvas.getBoundingClientRect();
    this.gauge.hidden = false;
    this.gauge.style.transform = `translate(${x - box.left}px, ${y - box.top}px)`;
    const step = () => {
      if (!this.held) return;
      const strength = heldStrength((performance.now() - this.held.since) / 1000);
      this.gauge.style.setProperty("--strength", strength.toFixed(3));
      requestAnimationFrame(step);
    };
    step();
  }

  /** @param {PointerEvent} event @returns {{name: string, distance: number} | null} */
  #mark(event) {
    const box = this.view.canvas.getBoundingClientRect();
    const caster = new THREE.Raycaster();
    const place = new THREE.Vector2(
      (2 * (event.clientX - box.left)) / box.width - 1,
      1 - (2 * (event.clientY - box.top)) / box.height,
    );
    caster.setFromCamera(place, this.view.camera);
    return this.marks?.hit(caster.ray) ?? null;
  }

  /** @param {KeyboardEvent} event on the canvas */
  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const way = WAYS[event.key];
    if (way && event.shiftKey) {
      this.view.move({ right: way[0] * SHIFT_PIXELS, down: way[1] * SHIFT_PIXELS });
    } else if (way) {
      this.view.move({ left: way[0] * TURN, up: way[1] * TURN });
    } else if (event.key === "+" || event.key === "=") {
      this.view.move({ nearer: NEARER });
    } else if (event.key === "-") {
      this.view.move({ nearer: 1 / NEARER });
    } else if (event.key === "Home") {
      this.view.reset();
    } else if (event.key === " ") {
      if (!event.repeat) this.#middle();
    } else {
      return;
    }
    event.preventDefault();
  }

  /** What a press on the middle of the view does, where the cross is. */
  #middle() {
    const { x, y } = this.view.middle();
    const picked = this.view.pick(x, y);
    if (!picked) return;
    const { tool } = this.selection.current;
    if (tool === "place") this.deeds.place(picked.vertex);
    else if (tool === "point") this.painting?.point(picked.point);
    else if (tool === "paint") {
      this.#begin(x, y);
      this.#end();
    }
    else this.deeds.strike(picked.vertex, this.selection.current.strength);
  }

  /** Begins to paint. @param {number} x pixels of the page @param {number} y */
  #begin(x, y) {
    this.painting?.brush.begin(x, y, this.painting.radius(), this.painting.dab);
  }

  /** Goes on painting, if a stroke goes on. @param {number} x @param {number} y */
  #go(x, y) {
    this.painting?.brush.go(x, y, this.painting.dab);
  }

  #end() {
    this.painting?.paint(this.painting.brush.end());
  }
}
