/** A body as it is drawn, and found under the pointer. */

import * as THREE from "three";
import { Picking } from "../page/solid/picking.js";
import { Surface } from "../page/solid/surface.js";
import { extentOf, placeAt } from "./motion.js";

/** @typedef {import("./content.js").Body} Body */
/** @typedef {import("./motion.js").Track} Track */

/** Of a body's radius. */
const DOT_RADIUS = 0.05;
const DOT_SECONDS = 1.2;

export class Actor {
  /**
   * @param {Body} body
   * @param {Track} track
   */
  constructor(body, track) {
    this.body = body;
    this.track = track;
    this.surface = new Surface(body.positions, body.triangles);
    this.surface.paintBare(new THREE.Color().setRGB(...body.colour, THREE.SRGBColorSpace));
    this.mesh = this.surface.mesh;
    this.mesh.castShadow = true;
    this.mesh.receiveShadow = true;
    /** @type {Picking | null} */
    this.picking = null;
    this.place = [0, 0, 0, 1, 0, 0, 0];
    /** Where it was struck, in the place of a wave. @type {THREE.Mesh | null} */
    this.dot = null;
    this.dotSeconds = 0;
  }

  /** @param {number} seconds of the scene */
  moveTo(seconds) {
    const [x, y, z, real, i, j, k] = placeAt(this.track, this.body.number, seconds, this.place);
    this.mesh.position.set(x, y, z);
    this.mesh.quaternion.set(i, j, k, real);
    this.mesh.updateMatrixWorld();
  }

  /** @returns {THREE.Box3} in which it is all the time */
  extent() {
    const { low, high } = extentOf(this.track, this.body.number);
    const { center, radius } = this.surface.sphere;
    const box = new THREE.Box3(new THREE.Vector3(...low), new THREE.Vector3(...high));
    return box.expandByScalar(center.length() + radius);
  }

  /**
   * @param {THREE.Ray} ray
   * @returns {import("../page/solid/picking.js").Picked | null} its point in the body's own axes
   */
  hit(ray) {
    const own = ray.clone().applyMatrix4(this.mesh.matrixWorld.clone().invert());
    if (!own.intersectsSphere(this.surface.sphere)) return null;
    // Not before it is needed: it takes a moment for many triangles.
    this.picking ??= new Picking(this.surface);
    return this.picking.along(own);
  }

  /** @param {THREE.Vector3} point of the scene @returns {number} its vertex that is nearest */
  nearest(point) {
    const own = this.mesh.worldToLocal(point.clone());
    const { positions } = this.surface;
    let [vertex, least] = [0, Infinity];
    for (let i = 0; i < positions.length; i += 3) {
      const [x, y, z] = [positions[i] - own.x, positions[i + 1] - own.y, positions[i + 2] - own.z];
      const square = x * x + y * y + z * z;
      if (square < least) [vertex, least] = [i / 3, square];
    }
    return vertex;
  }

  /**
   * Shows where it is struck.
   *
   * @param {THREE.Vector3} point in its own axes
   * @param {number} strength 0 to 1
   * @param {boolean} moving Whether by a wave that runs over it, or by a dot.
   */
  mark(point, strength, moving) {
    if (moving) {
      this.surface.waves.start(point, strength);
      return;
    }
    if (!this.dot) {
      const radius = DOT_RADIUS * this.surface.sphere.radius;
      const white = new THREE.MeshBasicMaterial({ color: 0xffffff, depthTest: false });
      this.dot = new THREE.Mesh(new THREE.SphereGeometry(radius, 16, 12), white);
      this.mesh.add(this.dot);
    }
    this.dot.position.copy(point);
    this.dot.visible = true;
    this.dotSeconds = DOT_SECONDS;
  }

  /** @param {number} seconds since the last picture @returns {boolean} whether a mark still moves */
  advance(seconds) {
    const runs = this.surface.waves.advance(seconds);
    if (!this.dot?.visible) return runs;
    this.dotSeconds -= seconds;
    this.dot.visible = this.dotSeconds > 0;
    return true;
  }
}
