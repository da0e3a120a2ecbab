/** Arrows along the inward normals at targets, each with its name on a button. */

import * as THREE from "three";

/** @typedef {import("./view.js").View} View */

/**
 * @typedef {object} Mark
 * @property {string} name
 * @property {number} vertex
 */

// Lengths are shares of the solid's radius.
const LENGTH = 0.34;
const HEAD = 0.12;
const CLEARANCE = 0.012;

/** @returns {THREE.BufferGeometry} an arrow along z whose tip is at the origin, of length 1 */
function arrow() {
  const share = HEAD / LENGTH;
  const head = new THREE.ConeGeometry(0.13, share, 24).rotateX(Math.PI / 2).translate(0, 0, -share / 2);
  const shaft = new THREE.CylinderGeometry(0.04, 0.04, 1 - share, 16)
    .rotateX(Math.PI / 2)
    .translate(0, 0, -(1 + share) / 2);
  return joined([head, shaft]);
}

/** @param {THREE.BufferGeometry[]} parts @returns {THREE.BufferGeometry} all of them as one */
function joined(parts) {
  const whole = new THREE.BufferGeometry();
  const flat = parts.map((part) => part.toNonIndexed());
  for (const name of ["position", "normal"]) {
    const values = flat.flatMap((part) => [...part.getAttribute(name).array]);
    whole.setAttribute(name, new THREE.Float32BufferAttribute(values, 3));
  }
  return whole;
}

export class Marks {
  /**
   * @param {View} view
   * @param {HTMLElement} element the labels' place, over the canvas
   * @param {(name: string) => void} chosen called when a mark is clicked
   */
  constructor(view, element, chosen) {
    this.view = view;
    this.element = element;
    this.chosen = chosen;
    this.group = new THREE.Group();
    view.scene.add(this.group);
    this.geometry = arrow();
    this.usual = new THREE.MeshLambertMaterial();
    this.selected = new THREE.MeshLambertMaterial();
    this.ghostly = new THREE.MeshLambertMaterial({ transparent: true, opacity: 0.55 });
    this.ghost = new THREE.Mesh(this.geometry, this.ghostly);
    this.ghost.visible = false;
    view.scene.add(this.ghost);
    /** @type {Float32Array | null} */
    this.inward = null;
    /** @type {Map<string, {mesh: THREE.Mesh, label: HTMLButtonElement, vertex: number}>} */
    this.marks = new Map();
    view.beforeDrawing.add(() => this.#place());
    this.takeColours();
  }

  /** Takes colours from the styles, which follow the time of day. */
  takeColours() {
    const styles = getComputedStyle(this.element);
    this.usual.color.set(styles.getPropertyValue("--quiet").trim());
    this.selected.color.set(styles.getPropertyValue("--target").trim());
    this.ghostly.color.copy(this.selected.color);
    this.view.invalidate();
  }

  /** @param {Float32Array | null} inward unit normals of the solid's vertices, (V, 3) */
  setInward(inward) {
    this.inward = inward;
    for (const { mesh, vertex } of this.marks.values()) this.#orient(mesh, vertex);
  }

  /**
   * Shows these marks, and no others.
   *
   * @param {Mark[]} marks
   * @param {string | null} selected the name of one of them
   */
  show(marks, selected) {
    const names = new Set(marks.map(({ name }) => name));
    for (const [name, { mesh, label }] of this.marks) {
      if (names.has(name)) continue;
      this.group.remove(mesh);
      label.remove();
      this.marks.delete(name);
    }
    for (const { name, vertex } of marks) {
      const mark = this.marks.get(name) ?? this.#make(name);
      mark.vertex = vertex;
      mark.mesh.material = name === selected ? this.selected : this.usual;
      mark.label.setAttribute("aria-pressed", String(name === selected));
      this.#orient(mark.mesh, vertex);
    }
    this.view.invalidate();
  }

  /** Shows where a target would be. @param {number | null} vertex */
  showGhost(vertex) {
    this.ghost.visible = vertex !== null && this.#orient(this.ghost, vertex);
    this.view.invalidate();
  }

  /**
   * @param {THREE.Ray} ray
   * @returns {{name: string, distance: number} | null} the nearest arrow
   */
  hit(ray) {
    const caster = new THREE.Raycaster(ray.origin, ray.direction);
    const found = caster.intersectObjects(this.group.children.filter((mesh) => mesh.visible))[0];
    return found ? { name: found.object.name, distance: found.distance } : null;
  }

  /** @param {string} name */
  #make(name) {
    const mesh = new THREE.Mesh(this.geometry, this.usual);
    mesh.name = name;
    const label = document.createElement("button");
    label.type = "button";
    label.className = "mark";
    label.textContent = name;
    label.title = `Select target ${name}`;
    label.onclick = () => this.chosen(name);
    this.group.add(mesh);
    this.element.append(label);
    const mark = { mesh, label, vertex: 0 };
    this.marks.set(name, mark);
    return mark;
  }

  /** @param {THREE.Mesh} mesh @param {number} vertex @returns {boolean} whether there is such a vertex */
  #orient(mesh, vertex) {
    const surface = this.view.surface;
    const known = surface !== null && this.inward !== null && 3 * vertex < surface.positions.length;
    mesh.visible = known;
    if (!surface || !this.inward || !known) return false;
    const into = new THREE.Vector3().fromArray(this.inward, 3 * vertex);
    const { radius } = surface.sphere;
    mesh.position.copy(surface.at(vertex)).addScaledVector(into, -CLEARANCE * radius);
    mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), into);
    mesh.scale.setScalar(LENGTH * radius);
    return true;
  }

  /** Puts labels at the arrows' tails, fainter where the solid hides these. */
  #place() {
    const { width, height } = this.view.canvas.getBoundingClientRect();
    for (const { mesh, label } of this.marks.values()) {
      const tail = mesh.localToWorld(new THREE.Vector3(0, 0, -1.05));
      const { x, y, ahead } = this.view.projected(tail);
      label.hidden = !mesh.visible || !ahead || x < 0 || y < 0 || x > width || y > height;
      if (label.hidden) continue;
      label.classList.toggle("behind", this.view.picking?.hides(tail, this.view.camera) ?? false);
      const half = label.offsetWidth / 2;
      const left = Math.min(Math.max(x, half + 4), width - half - 4);
      label.style.transform = `translate(${left.toFixed(1)}px, ${y.toFixed(1)}px) translate(-50%, -50%)`;
    }
  }
}
