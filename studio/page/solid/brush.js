/** The brush: places along a stroke over the solid, and the ring that shows how wide it is. */

import * as THREE from "three";

/** @typedef {import("./view.js").View} View */
/** @typedef {import("./picking.js").Picked} Picked */
/** @typedef {import("./composition.js").Dab} Dab */

// Places of a stroke are so many radii apart.
const APART = 0.4;
const STEP_PIXELS = 6;
const SEGMENTS = 48;
const MOST_DABS = 2000;
const DIGITS = 6;

export class Brush {
  /** @param {View} view */
  constructor(view) {
    this.view = view;
    const points = Array.from({ length: SEGMENTS }, (_, i) => {
      const angle = (2 * Math.PI * i) / SEGMENTS;
      return new THREE.Vector3(Math.cos(angle), Math.sin(angle), 0);
    });
    this.line = new THREE.LineBasicMaterial({ depthTest: false, transparent: true });
    this.ring = new THREE.LineLoop(new THREE.BufferGeometry().setFromPoints(points), this.line);
    this.ring.visible = false;
    this.ring.renderOrder = 2;
    view.scene.add(this.ring);
    /** @type {Float32Array | null} */
    this.inward = null;
    /** @type {{dabs: Dab[], x: number, y: number, radius: number} | null} */
    this.stroke = null;
  }

  /**
   * Shows where the brush is.
   *
   * @param {Picked | null} picked
   * @param {number} radius [m]; negative if paint is taken away
   */
  hover(picked, radius) {
    this.ring.visible = picked !== null && this.inward !== null;
    if (picked && this.inward) {
      const inward = new THREE.Vector3().fromArray(this.inward, 3 * picked.vertex);
      this.ring.position.copy(picked.point);
      this.ring.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), inward);
      this.ring.scale.setScalar(Math.abs(radius));
      this.line.color.set(radius < 0 ? 0xb3241d : 0x10181b);
    }
    this.view.invalidate();
  }

  /**
   * Begins a stroke.
   *
   * @param {number} x pixels of the page
   * @param {number} y
   * @param {number} radius [m]
   * @param {(dab: Dab, vertex: number) => void} dabbed told of each place
   */
  begin(x, y, radius, dabbed) {
    this.stroke = { dabs: [], x, y, radius };
    this.#add(x, y, dabbed);
  }

  /**
   * Goes on with a stroke, along a line of the screen.
   *
   * @param {number} x
   * @param {number} y
   * @param {(dab: Dab, vertex: number) => void} dabbed
   */
  go(x, y, dabbed) {
    const { stroke } = this;
    if (!stroke) return;
    const steps = Math.max(1, Math.ceil(Math.hypot(x - stroke.x, y - stroke.y) / STEP_PIXELS));
    const [fromX, fromY] = [stroke.x, stroke.y];
    for (let step = 1; step <= steps; step++) {
      this.#add(fromX + ((x - fromX) * step) / steps, fromY + ((y - fromY) * step) / steps, dabbed);
    }
    [stroke.x, stroke.y] = [x, y];
  }

  /** Ends a stroke. @returns {Dab[]} its places */
  end() {
    const dabs = this.stroke?.dabs ?? [];
    this.stroke = null;
    return dabs;
  }

  /** @param {number} x @param {number} y @param {(dab: Dab, vertex: number) => void} dabbed */
  #add(x, y, dabbed) {
    const { stroke } = this;
    const picked = this.view.pick(x, y);
    if (!picked || !stroke || stroke.dabs.length >= MOST_DABS) return;
    const dab = dabAt(picked.point, stroke.radius);
    const last = stroke.dabs.at(-1);
    if (last && Math.hypot(...last.slice(0, 3).map((value, i) => value - dab[i])) < APART * Math.abs(stroke.radius)) return;
    stroke.dabs.push(dab);
    dabbed(dab, picked.vertex);
  }
}

/** @param {THREE.Vector3} point @param {number} radius @returns {Dab} */
export function dabAt(point, radius) {
  const [x, y, z, r] = [point.x, point.y, point.z, radius].map((value) => Number(value.toPrecision(DIGITS)));
  return [x, y, z, r];
}
