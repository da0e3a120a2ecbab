/** Which vertex of the solid lies under a point of the screen. */

import * as THREE from "three";
import { MeshBVH } from "three-mesh-bvh";

/** @typedef {import("./surface.js").Surface} Surface */

/**
 * @typedef {object} Picked
 * @property {number} vertex of the solid, the hit triangle's nearest
 * @property {THREE.Vector3} point that was hit [m]
 * @property {number} distance from the camera [m]
 */

export class Picking {
  /** @param {Surface} surface */
  constructor(surface) {
    this.surface = surface;
    // Indirect: the order of triangles stays, which is what is drawn.
    this.tree = new MeshBVH(surface.geometry, { indirect: true });
    this.caster = new THREE.Raycaster();
  }

  /**
   * @param {THREE.Vector2} place -1 to 1 from left to right and from bottom to top
   * @param {THREE.Camera} camera
   * @returns {Picked | null} null beside the solid
   */
  pick(place, camera) {
    this.caster.setFromCamera(place, camera);
    return this.along(this.caster.ray);
  }

  /**
   * @param {THREE.Ray} ray in the surface's own axes
   * @returns {Picked | null} null beside the solid; its distance is that from where the ray begins
   */
  along(ray) {
    const hit = this.tree.raycastFirst(ray, THREE.DoubleSide);
    if (!hit?.face) return null;
    let [vertex, least] = [-1, Infinity];
    for (const corner of [hit.face.a, hit.face.b, hit.face.c]) {
      const candidate = this.surface.sources[corner];
      const distance = this.surface.at(candidate).distanceToSquared(hit.point);
      if (distance < least) [vertex, least] = [candidate, distance];
    }
    return { vertex, point: hit.point, distance: hit.distance };
  }

  /**
   * Whether the solid hides a point from the camera.
   *
   * @param {THREE.Vector3} point
   * @param {THREE.Camera} camera
   * @returns {boolean}
   */
  hides(point, camera) {
    const projected = point.clone().project(camera);
    this.caster.setFromCamera(new THREE.Vector2(projected.x, projected.y), camera);
    const hit = this.tree.raycastFirst(this.caster.ray, THREE.DoubleSide);
    const away = this.caster.ray.origin.distanceTo(point);
    return hit !== null && hit.distance < away - 0.002 * this.surface.sphere.radius;
  }
}
