/** Camera and drawing: the solid is drawn when something changed, and as long as something moves. */

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { Picking } from "./picking.js";
import { Surface } from "./surface.js";

/** @typedef {import("./picking.js").Picked} Picked */

export const NO_GRAPHICS =
  "This browser draws no 3D (WebGL 2): allow hardware acceleration, or take another browser. " +
  "Targets can still be struck and heard.";

// From the front, a little from the left and from above; z points up.
const FROM = new THREE.Vector3(-0.45, -1, 0.55).normalize();
const FIELD_DEGREES = 32;
// Around the solid stays some of the view, as arrows stand out of it.
const ROOM = 1.15;
// Slower than this while something moves, and it is drawn coarser until it stands still.
const SLOW_SECONDS = 1 / 30;
const COARSEST = 0.5;
const NEITHER = /** @type {any} */ (-1);

/**
 * Whether the browser draws without a graphics card, where smooth edges take three times as long.
 *
 * @returns {boolean}
 */
function drawnBySoftware() {
  const context = document.createElement("canvas").getContext("webgl2");
  if (!context) return false;
  const told = context.getExtension("WEBGL_debug_renderer_info");
  const name = told ? String(context.getParameter(told.UNMASKED_RENDERER_WEBGL)) : "";
  context.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

export class View {
  /**
   * @param {HTMLElement} element that the canvas fills
   * @throws {Error} one sentence, where the browser draws no 3D
   */
  constructor(element) {
    this.element = element;
    const canvas = document.createElement("canvas");
    this.canvas = canvas;
    // three would write its own error to the console, and several lines of it.
    const antialias = !drawnBySoftware();
    const context = canvas.getContext("webgl2", { antialias, alpha: true });
    if (!context) throw new Error(NO_GRAPHICS);
    this.renderer = new THREE.WebGLRenderer({ canvas, context, alpha: true, antialias });
    this.renderer.setClearColor(0, 0);
    canvas.tabIndex = 0;
    element.prepend(canvas);

    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(FIELD_DEGREES, 1, 0.01, 10);
    this.camera.up.set(0, 0, 1);
    this.scene.add(this.camera);
    this.light();

    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.controls.dampingFactor = 0.2;
    this.controls.mouseButtons = {
      LEFT: THREE.MOUSE.ROTATE,
      MIDDLE: THREE.MOUSE.PAN,
      RIGHT: THREE.MOUSE.ROTATE,
    };
    this.controls.touches = { ONE: THREE.TOUCH.ROTATE, TWO: THREE.TOUCH.DOLLY_ROTATE };
    this.controls.addEventListener("change", () => this.invalidate());
    // Whether the camera is where `fit` left it; it stays fitted when the window changes.
    this.fitted = false;
    this.controls.addEventListener("start", () => (this.fitted = false));

    /** @type {Surface | null} */
    this.surface = null;
    /** @type {Picking | null} */
    this.picking = null;
    /** Called before each drawing. @type {Set<() => void>} */
    this.beforeDrawing = new Set();
    /** Pixels at the top and at the bottom that something lies over. @type {() => [number, number]} */
    this.margins = () => [0, 0];
    this.drawings = 0;
    this.lost = false;
    this.waiting = 0;
    this.last = 0;
    // Share of the pixels' number along each side, and how long drawings take of late.
    this.sharpness = 1;
    this.pace = 0;
    this.moved = false;
    /** @type {(lost: boolean) => void} */
    this.onLost = () => {};
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault(); // or it never comes back
      this.lost = true;
      this.onLost(true);
    });
    canvas.addEventListener("webglcontextrestored", () => {
      this.lost = false;
      this.onLost(false);
      this.invalidate();
    });
    new ResizeObserver(() => this.resize()).observe(element);
    this.resize();
  }

  /** Lights the scene: together they show what faces the camera as bright as the legend does. */
  light() {
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0xb8bcc4, 0.42 * Math.PI));
    const light = new THREE.DirectionalLight(0xffffff, 0.62 * Math.PI);
    light.position.set(-0.5, 0.8, 1.2);
    this.camera.add(light);
  }

  /**
   * Lets pass what moves by itself, before each drawing.
   *
   * @param {number} seconds since the last one
   * @returns {boolean} whether anything still moves
   */
  advance(seconds) {
    return this.surface?.waves.advance(seconds) ?? false;
  }

  /**
   * Shows another solid, from where the camera fits all of it.
   *
   * @param {Float32Array} positions (V, 3) [m]
   * @param {Uint32Array} triangles (F, 3)
   */
  setSurface(positions, triangles) {
    const before = this.surface;
    this.clear();
    this.surface = new Surface(positions, triangles);
    this.picking = new Picking(this.surface);
    this.scene.add(this.surface.mesh);
    const [now, then] = [this.surface.sphere, before?.sphere];
    const alike =
      then && now.center.distanceTo(then.center) < 0.1 * now.radius && Math.abs(now.radius / then.radius - 1) < 0.1;
    // The fine solid and the coarse one are looked at from the same place.
    if (!alike) this.reset();
    this.invalidate();
  }

  /** Shows no solid. */
  clear() {
    if (this.surface) {
      this.scene.remove(this.surface.mesh);
      this.surface.dispose();
    }
    this.surface = null;
    this.picking = null;
    this.invalidate();
  }

  /**
   * Moves the camera to where it sees all of the solid.
   *
   * @param {THREE.Vector3} [from] unit vector towards the camera; it looks from where it did without
   */
  fit(from = this.camera.position.clone().sub(this.controls.target).normalize()) {
    if (!this.surface) return;
    const { center, radius } = this.surface.sphere;
    this.halt();
    this.controls.target.copy(center);
    this.camera.position.copy(center).addScaledVector(from, this.#distance(from));
    this.camera.near = radius / 50;
    this.camera.far = 60 * radius;
    this.controls.minDistance = 0.3 * radius;
    this.controls.maxDistance = 25 * radius;
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.fitted = true;
    this.invalidate();
  }

  /** Looks at all of the solid from where it was seen first. */
  reset() {
    this.fit(FROM);
  }

  /** Ends what is left of a turn that was let go. */
  halt() {
    const { enableDamping } = this.controls;
    this.controls.enableDamping = false;
    this.controls.update();
    this.controls.enableDamping = enableDamping;
  }

  /** @param {THREE.Vector3} from unit vector towards the camera @returns {number} least distance that shows all [m] */
  #distance(from) {
    const surface = /** @type {Surface} */ (this.surface);
    const { clientWidth: width, clientHeight: height } = this.element;
    const [top, bottom] = this.#shift();
    const slope = Math.tan((this.camera.fov * Math.PI) / 360) / height;
    const steep = slope * Math.max(0.4 * height, height - top - bottom);
    const wide = slope * width;
    const right = new THREE.Vector3().crossVectors(this.camera.up, from).normalize();
    const up = new THREE.Vector3().crossVectors(from, right);
    const [point, { center, radius }] = [new THREE.Vector3(), surface.sphere];
    let distance = 0.5 * radius;
    for (let i = 0; i < surface.positions.length; i += 3) {
      point.fromArray(surface.positions, i).sub(center);
      const beside = Math.max(Math.abs(point.dot(right)) / wide, Math.abs(point.dot(up)) / steep);
      distance = Math.max(distance, ROOM * beside + point.dot(from));
    }
    return distance;
  }

  /** @returns {[number, number]} the margins, between which the camera's middle now is */
  #shift() {
    const { clientWidth: width, clientHeight: height } = this.element;
    const margins = this.margins();
    const up = Math.round((margins[1] - margins[0]) / 2);
    this.camera.setViewOffset(width, height, 0, up, width, height);
    this.element.style.setProperty("--middle", `${height / 2 - up}px`);
    return margins;
  }

  /** @returns {{x: number, y: number}} pixels of the page of what the camera looks at */
  middle() {
    const box = this.canvas.getBoundingClientRect();
    const [top, bottom] = this.margins();
    return { x: box.left + box.width / 2, y: box.top + (box.height + Math.round(top - bottom)) / 2 };
  }

  /** Lets the left button, or one finger, turn the solid or not, from the next press on. @param {boolean} turns */
  letTurn(turns) {
    this.controls.mouseButtons.LEFT = turns ? THREE.MOUSE.ROTATE : NEITHER;
    this.controls.touches.ONE = turns ? THREE.TOUCH.ROTATE : NEITHER;
  }

  /**
   * Turns and shifts the camera, for keys.
   *
   * @param {{left?: number, up?: number, right?: number, down?: number, nearer?: number}} way radians to the left and
   *     up, pixels to the right and down, factor by which it comes nearer
   */
  move({ left = 0, up = 0, right = 0, down = 0, nearer = 1 }) {
    this.fitted = false;
    if (left) this.controls.rotateLeft(left);
    if (up) this.controls.rotateUp(up);
    if (right || down) this.controls.pan(right, down);
    if (nearer > 1) this.controls.dollyIn(1 / nearer);
    if (nearer < 1) this.controls.dollyOut(nearer);
    this.controls.update();
    this.invalidate();
  }

  /**
   * @param {number} x pixels of the page, as events tell them
   * @param {number} y
   * @returns {Picked | null} null beside the solid
   */
  pick(x, y) {
    const box = this.canvas.getBoundingClientRect();
    const place = new THREE.Vector2(
      (2 * (x - box.left)) / box.width - 1,
      1 - (2 * (y - box.top)) / box.height,
    );
    this.camera.updateMatrixWorld();
    return this.picking?.pick(place, this.camera) ?? null;
  }

  /**
   * @param {THREE.Vector3} point [m]
   * @returns {{x: number, y: number, ahead: boolean}} pixels from the view's left and top
   */
  projected(point) {
    this.camera.updateMatrixWorld();
    const { x, y, z } = point.clone().project(this.camera);
    const { clientWidth, clientHeight } = this.canvas;
    return { x: ((x + 1) / 2) * clientWidth, y: ((1 - y) / 2) * clientHeight, ahead: z < 1 };
  }

  /**
   * @param {number} vertex
   * @returns {{x: number, y: number, hidden: boolean} | null} pixels of the page; null without a solid
   */
  project(vertex) {
    if (!this.surface || !this.picking) return null;
    const point = this.surface.at(vertex);
    const { x, y, ahead } = this.projected(point);
    const box = this.canvas.getBoundingClientRect();
    return { x: x + box.left, y: y + box.top, hidden: !ahead || this.picking.hides(point, this.camera) };
  }

  /** Lets a wave run from where the solid was struck. @param {number} vertex @param {number} strength */
  wave(vertex, strength) {
    if (!this.surface) return;
    this.surface.waves.start(this.surface.at(vertex), strength);
    this.last = performance.now();
    this.invalidate();
  }

  /** Draws soon; once, however often it is called. */
  invalidate() {
    if (this.waiting === 0) this.waiting = requestAnimationFrame((time) => this.#draw(time));
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.element;
    if (width === 0 || height === 0) return;
    this.#setPixels();
    this.camera.aspect = width / height;
    this.#shift();
    if (this.fitted) this.fit();
    this.invalidate();
  }

  #setPixels() {
    this.renderer.setPixelRatio(this.sharpness * Math.min(devicePixelRatio, 2));
    this.renderer.setSize(this.element.clientWidth, this.element.clientHeight, false);
  }

  /** @param {number} time [ms] */
  #draw(time) {
    this.waiting = 0;
    if (this.lost) return;
    const turns = this.controls.update();
    const seconds = Math.max(0, (time - this.last) / 1000);
    this.last = time;
    const runs = this.advance(Math.min(0.1, seconds));
    this.#choose(turns || runs, seconds);
    for (const called of this.beforeDrawing) called();
    this.renderer.render(this.scene, this.camera);
    this.drawings++;
    // What was drawn coarser is drawn once more when it stands still.
    if (turns || runs || this.sharpness < 1) this.invalidate();
  }

  /**
   * Chooses how sharp the next drawing is.
   *
   * @param {boolean} moves
   * @param {number} seconds since the last one
   */
  #choose(moves, seconds) {
    const before = this.sharpness;
    if (!moves) {
      this.sharpness = 1;
    } else if (this.moved) {
      this.pace = Math.min(0.5, 0.7 * this.pace + 0.3 * seconds);
      if (this.pace > 1.3 * SLOW_SECONDS) this.sharpness = Math.max(COARSEST, 0.7 * this.sharpness);
      if (this.sharpness !== before) this.pace = SLOW_SECONDS; // it takes some drawings to tell again
    } else if (this.pace > 1.3 * SLOW_SECONDS) {
      this.sharpness = COARSEST; // it was slow the last time
    }
    this.moved = moves;
    if (this.sharpness !== before) this.#setPixels();
  }
}
