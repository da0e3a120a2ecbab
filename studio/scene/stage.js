/** The scene in 3D: bodies that move, the ground, light that casts shadows, a camera that turns. */

import * as THREE from "three";
import { View } from "../page/solid/view.js";
import { Actor } from "./actor.js";
import { Ground } from "./ground.js";

/** @typedef {import("./content.js").Body} Body */
/** @typedef {import("./content.js").Scene} Scene */

/**
 * @typedef {object} Hit
 * @property {Body} body
 * @property {number} vertex of it that is nearest to where it was hit
 * @property {THREE.Vector3} point in its own axes [m]
 * @property {number} distance from the camera [m]
 */

// Narrower views see as much from left to right as one of this shape.
const SHAPE = 16 / 9;
const WIDEST_DEGREES = 75;
// From the left, from the front, and mostly from above.
const SUN = new THREE.Vector3(-0.45, -0.35, 1).normalize();
const SHADOW_PIXELS = 2048;
const SHADOW_PIXELS_BY_SOFTWARE = 1024;
const DEPTHS = { light: 0.3, dark: 0.55 };
const DARK = matchMedia("(prefers-color-scheme: dark)");
const STILL = matchMedia("(prefers-reduced-motion: reduce)");

export class Stage extends View {
  /**
   * @param {HTMLElement} element
   * @param {Scene} scene
   * @throws {Error} one sentence, where the browser draws no 3D
   */
  constructor(element, scene) {
    super(element);
    this.played = scene;
    this.actors = scene.bodies.map((body) => new Actor(body, scene.track));
    for (const { mesh } of this.actors) this.scene.add(mesh);
    /** Called before each picture. @type {() => {seconds: number, moves: boolean}} */
    this.frame = () => ({ seconds: 0, moves: false });
    this.arena = this.#arena();
    this.ground = scene.ground === null ? null : new Ground(scene.ground, this.arena);
    if (this.ground) this.scene.add(this.ground.group);
    this.#shine();
    this.#takeColours();
    DARK.addEventListener("change", () => this.#takeColours());
    this.show(0);
    this.reset();
  }

  /** Its light casts shadows, and comes with the scene: see `#shine`. */
  light() {}

  /** @returns {THREE.Sphere} in which bodies are, as far as the camera is about to see */
  #arena() {
    const box = new THREE.Box3();
    for (const actor of this.actors) box.union(actor.extent());
    const sphere = box.getBoundingSphere(new THREE.Sphere());
    const { position, target } = this.played.camera;
    const away = new THREE.Vector3(...position).distanceTo(new THREE.Vector3(...target));
    // What rolls away for long must not spread the shadow's pixels over all its way.
    if (sphere.radius > 2 * away) sphere.set(new THREE.Vector3(...target), 2 * away);
    if (!(sphere.radius > 0)) sphere.set(new THREE.Vector3(...target), away || 1);
    return sphere;
  }

  #shine() {
    const { center, radius } = this.arena;
    const sky = new THREE.HemisphereLight(0xffffff, 0x8d8f94, 0.62 * Math.PI);
    sky.position.set(0, 0, 1);
    const sun = new THREE.DirectionalLight(0xfffaf2, 0.5 * Math.PI);
    sun.position.copy(center).addScaledVector(SUN, 2 * radius);
    sun.target.position.copy(center);
    sun.castShadow = true;
    const { camera, mapSize } = sun.shadow;
    const { antialias } = this.renderer.getContext().getContextAttributes() ?? {};
    mapSize.setScalar(antialias ? SHADOW_PIXELS : SHADOW_PIXELS_BY_SOFTWARE);
    [camera.left, camera.right, camera.bottom, camera.top] = [-radius, radius, -radius, radius];
    [camera.near, camera.far] = [0.5 * radius, 4 * radius];
    sun.shadow.normalBias = (3 * radius) / mapSize.x;
    sun.shadow.radius = 3;
    this.renderer.shadowMap.enabled = true;
    this.scene.add(sky, sun, sun.target);
  }

  #takeColours() {
    const style = getComputedStyle(this.element);
    /** @param {string} name */
    const colour = (name) => new THREE.Color(style.getPropertyValue(name).trim());
    const depth = DARK.matches ? DEPTHS.dark : DEPTHS.light;
    this.ground?.takeColours(colour("--ground"), colour("--grid"), depth);
    this.invalidate();
  }

  /** Looks from where the scene is to be looked at. */
  reset() {
    const { position, target, degrees } = this.played.camera;
    const { controls, camera } = this;
    this.halt();
    camera.position.set(position[0], position[1], position[2]);
    controls.target.set(target[0], target[1], target[2]);
    this.degrees = degrees;
    const away = camera.position.distanceTo(controls.target);
    const size = Math.max(away, this.arena.radius);
    [camera.near, camera.far] = [away / 200, 40 * size];
    [controls.minDistance, controls.maxDistance] = [away / 20, 8 * size];
    // Not below the ground, unless it begins there.
    const polar = Math.acos(Math.min(1, Math.max(-1, (position[2] - target[2]) / away)));
    controls.maxPolarAngle = this.ground ? Math.max(0.495 * Math.PI, polar) : Math.PI;
    this.resize();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.element;
    if (this.degrees && width > 0 && height > 0) {
      const narrow = Math.max(1, (SHAPE * height) / width);
      const slope = narrow * Math.tan((this.degrees * Math.PI) / 360);
      this.camera.fov = Math.min(WIDEST_DEGREES, (360 / Math.PI) * Math.atan(slope));
      this.camera.updateProjectionMatrix();
    }
    super.resize();
  }

  /** @param {number} seconds of the scene */
  show(seconds) {
    for (const actor of this.actors) actor.moveTo(seconds);
  }

  /** @param {number} passed seconds since the last picture @returns {boolean} whether anything moves */
  advance(passed) {
    const { seconds, moves } = this.frame();
    this.show(seconds);
    const marked = this.actors.map((actor) => actor.advance(passed));
    return moves || marked.includes(true);
  }

  /**
   * @param {number} x pixels of the page
   * @param {number} y
   * @returns {Hit | null} null beside all bodies
   */
  hit(x, y) {
    const box = this.canvas.getBoundingClientRect();
    const across = (2 * (x - box.left)) / box.width - 1;
    const up = 1 - (2 * (y - box.top)) / box.height;
    const caster = new THREE.Raycaster();
    this.camera.updateMatrixWorld();
    caster.setFromCamera(new THREE.Vector2(across, up), this.camera);
    /** @type {Hit | null} */
    let nearest = null;
    for (const actor of this.actors) {
      const hit = actor.hit(caster.ray);
      if (hit && hit.distance < (nearest?.distance ?? Infinity)) nearest = { ...hit, body: actor.body };
    }
    return nearest;
  }

  /**
   * @param {Body} body
   * @returns {number} its vertex that is nearest to the camera
   */
  facing({ number }) {
    return this.actors[number].nearest(this.camera.position);
  }

  /**
   * Shows where a body was struck.
   *
   * @param {Body} body
   * @param {number} vertex
   * @param {number} strength 0 to 1
   */
  mark({ number }, vertex, strength) {
    const actor = this.actors[number];
    this.#mark(actor, actor.surface.at(vertex), strength);
  }

  /**
   * Shows where bodies strike each other.
   *
   * @param {import("./content.js").Impact} impact
   * @param {number} strength 0 to 1
   */
  markImpact({ pair, place }, strength) {
    if (STILL.matches) return;
    for (const number of pair) {
      const actor = this.actors[number];
      if (actor) this.#mark(actor, actor.mesh.worldToLocal(new THREE.Vector3(...place)), strength);
    }
  }

  /** @param {Actor} actor @param {THREE.Vector3} point @param {number} strength */
  #mark(actor, point, strength) {
    actor.mark(point, strength, !STILL.matches);
    this.last = performance.now();
    this.invalidate();
  }
}
