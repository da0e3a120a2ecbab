/** Symbols of supports at points, of springs, and of the grain of wood. */

import * as THREE from "three";
import { grainOf } from "../panels/materials.js";
import { hatchOf, HATCHES } from "./composition.js";

/** @typedef {import("../main.js").Parts} Parts */
/** @typedef {import("../types.js").Support} Support */
/** @typedef {import("../types.js").CompositionArrays} CompositionArrays */
/** @typedef {import("./view.js").View} View */

/** Stands out of iron, wood and the map of moduli alike. */
const USUAL = 0x2a9df4;
// Sizes are shares of the solid's radius.
const SIZE = 0.16;
const TURNS = 5;
const COIL_STEPS = 120;
const GRAIN = 0.8;
const LEAST_GRAIN = 0.25;

/** @returns {THREE.BufferGeometry} a coil along z from the origin, of length 1 */
function coil() {
  const points = Array.from({ length: COIL_STEPS + 1 }, (_, i) => {
    const share = i / COIL_STEPS;
    const angle = 2 * Math.PI * TURNS * share;
    const radius = share < 0.08 || share > 0.92 ? 0 : 0.22;
    return new THREE.Vector3(radius * Math.cos(angle), radius * Math.sin(angle), share);
  });
  return new THREE.TubeGeometry(new THREE.CatmullRomCurve3(points), COIL_STEPS, 0.035, 6);
}

/** @returns {THREE.BufferGeometry} a cone along z whose tip is at the origin, of length 1 */
function cone() {
  return new THREE.ConeGeometry(0.4, 1, 4).rotateX(-Math.PI / 2).translate(0, 0, 0.5);
}

export class Symbols {
  /**
   * @param {View} view
   * @param {Parts} parts
   */
  constructor(view, parts) {
    this.view = view;
    this.parts = parts;
    this.group = new THREE.Group();
    view.scene.add(this.group);
    this.shapes = { held: cone(), spring: coil(), mass: new THREE.SphereGeometry(0.35, 24, 16) };
    this.rod = new THREE.CylinderGeometry(0.01, 0.01, 1, 12).rotateX(Math.PI / 2);
    this.tip = new THREE.ConeGeometry(0.032, 0.11, 16).rotateX(Math.PI / 2).translate(0, 0, -0.055);
    this.usual = new THREE.MeshLambertMaterial({ color: USUAL });
    this.chosen = new THREE.MeshLambertMaterial();
    // Grain is seen through the solid.
    this.grain = new THREE.MeshBasicMaterial({ color: 0x4a2c12, depthTest: false, transparent: true, opacity: 0.95 });
    this.takeColours();
  }

  /** Takes the colour of what is selected from the styles. */
  takeColours() {
    this.chosen.color.set(getComputedStyle(this.view.element).getPropertyValue("--target").trim());
    this.view.invalidate();
  }

  /**
   * Shows supports and the grain of wood.
   *
   * @param {Float32Array | null} inward normals of the surface's vertices
   * @param {CompositionArrays | null} arrays where rows are on the surface
   */
  show(inward, arrays) {
    this.group.clear();
    const surface = this.view.surface;
    const state = this.parts.state.current;
    this.view.invalidate();
    if (!surface || !inward || !state) return;
    state.supports.forEach((support, number) => this.#support(support, number, inward, arrays));
    // Of moduli the colours tell, of which it is none.
    if (this.parts.selection.current.colouring !== "regions") return;
    state.regions.forEach((region, number) => {
      const grain = grainOf(region, this.parts.materials.named(region.material));
      if (grain && arrays) this.#grain(new THREE.Vector3(...grain), number, arrays);
    });
  }

  /**
   * @param {Support} support
   * @param {number} number
   * @param {Float32Array} inward
   * @param {CompositionArrays | null} arrays
   */
  #support(support, number, inward, arrays) {
    const surface = /** @type {import("./surface.js").Surface} */ (this.view.surface);
    const isPoint = support.at !== undefined && support.radius === undefined;
    const hatch = hatchOf(support);
    // What is held by area is hatched; springs by area get a symbol besides.
    if (!isPoint && hatch !== HATCHES.spring) return;
    const place = isPoint ? new THREE.Vector3(...(support.at ?? [0, 0, 0])) : middleOf(surface, arrays?.support, number);
    if (!place) return;
    const vertex = nearest(surface.positions, place);
    const outward = new THREE.Vector3().fromArray(inward, 3 * vertex).negate();
    const shape = support.mass !== undefined ? this.shapes.mass : hatch === HATCHES.spring ? this.shapes.spring : this.shapes.held;
    const { row } = this.parts.selection.current;
    const isChosen = row?.kind === "supports" && row.number === number;
    const mesh = new THREE.Mesh(shape, isChosen ? this.chosen : this.usual);
    mesh.position.copy(isPoint ? place : surface.at(vertex));
    mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), outward);
    mesh.scale.setScalar(SIZE * surface.sphere.radius);
    this.group.add(mesh);
  }

  /** @param {THREE.Vector3} grain @param {number} number of the region @param {CompositionArrays} arrays */
  #grain(grain, number, arrays) {
    const surface = /** @type {import("./surface.js").Surface} */ (this.view.surface);
    if (grain.length() === 0) return;
    grain.normalize();
    const box = new THREE.Box3();
    const point = new THREE.Vector3();
    arrays.region.forEach((region, vertex) => {
      if (region === number) box.expandByPoint(point.fromArray(surface.positions, 3 * vertex));
    });
    if (box.isEmpty()) return;
    const size = box.getSize(new THREE.Vector3());
    const { radius } = surface.sphere;
    const across = Math.abs(size.x * grain.x) + Math.abs(size.y * grain.y) + Math.abs(size.z * grain.z);
    const length = Math.max(GRAIN * across, LEAST_GRAIN * radius);
    const arrow = new THREE.Group();
    const rod = new THREE.Mesh(this.rod, this.grain);
    rod.scale.set(radius, radius, length);
    arrow.add(rod);
    for (const end of [1, -1]) {
      const tip = new THREE.Mesh(this.tip, this.grain);
      tip.scale.setScalar(radius);
      tip.position.z = (end * length) / 2;
      if (end < 0) tip.rotation.x = Math.PI;
      arrow.add(tip);
    }
    arrow.position.copy(box.getCenter(new THREE.Vector3()));
    arrow.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), grain);
    for (const part of arrow.children) part.renderOrder = 1;
    arrow.name = "grain";
    this.group.add(arrow);
  }
}

/**
 * @param {import("./surface.js").Surface} surface
 * @param {Uint16Array | undefined} numbers
 * @param {number} number
 * @returns {THREE.Vector3 | null} the mean of the vertices of a row
 */
function middleOf(surface, numbers, number) {
  const sum = new THREE.Vector3();
  let count = 0;
  numbers?.forEach((each, vertex) => {
    if (each !== number) return;
    sum.add(surface.at(vertex));
    count++;
  });
  return count === 0 ? null : sum.divideScalar(count);
}

/** @param {Float32Array} positions @param {THREE.Vector3} place @returns {number} the nearest vertex */
function nearest(positions, place) {
  let [vertex, least] = [0, Infinity];
  for (let i = 0; i < positions.length; i += 3) {
    const away = (positions[i] - place.x) ** 2 + (positions[i + 1] - place.y) ** 2 + (positions[i + 2] - place.z) ** 2;
    if (away < least) [vertex, least] = [i / 3, away];
  }
  return vertex;
}
