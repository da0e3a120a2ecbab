/** The surface of the solid: triangles, normals with creases, a colour a vertex, waves where it was struck. */

import * as THREE from "three";
import { paint } from "./colours.js";

// Faces that meet at more than this do so at an edge, which is shaded as one.
const CREASE_DEGREES = 40;
const WAVES = 6;
const WAVE_SECONDS = 0.7;

/**
 * Unit normals of triangles.
 *
 * @param {Float32Array} positions
 * @param {Uint32Array} triangles
 * @returns {{normals: Float32Array, areas: Float32Array}}
 */
function faceNormals(positions, triangles) {
  const count = triangles.length / 3;
  const normals = new Float32Array(3 * count);
  const areas = new Float32Array(count);
  for (let face = 0; face < count; face++) {
    const [a, b, c] = [3 * triangles[3 * face], 3 * triangles[3 * face + 1], 3 * triangles[3 * face + 2]];
    const [ux, uy, uz] = [0, 1, 2].map((i) => positions[b + i] - positions[a + i]);
    const [vx, vy, vz] = [0, 1, 2].map((i) => positions[c + i] - positions[a + i]);
    const [x, y, z] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    const length = Math.hypot(x, y, z);
    areas[face] = length / 2;
    const scale = length > 0 ? 1 / length : 0;
    normals.set([x * scale, y * scale, z * scale], 3 * face);
  }
  return { normals, areas };
}

/**
 * Vertices as they are drawn: one of the solid comes several times where it lies on a crease.
 *
 * @param {Float32Array} positions of the solid's vertices, (V, 3)
 * @param {Uint32Array} triangles (F, 3)
 * @returns {{sources: Uint32Array, index: Uint32Array, normals: Float32Array}} which vertex of the solid each
 *     drawn one is, triangles of drawn vertices, normals of these
 */
export function creased(positions, triangles) {
  const { normals: faces, areas } = faceNormals(positions, triangles);
  const least = Math.cos((CREASE_DEGREES * Math.PI) / 180);
  const index = new Uint32Array(triangles.length);
  /** @type {number[]} */
  const sources = [];
  /** @type {number[]} */
  const sums = [];
  /** The first drawn vertex of each of the solid, and the next one of the same. @type {Int32Array} */
  const first = new Int32Array(positions.length / 3).fill(-1);
  /** @type {number[]} */
  const next = [];
  for (let corner = 0; corner < triangles.length; corner++) {
    const vertex = triangles[corner];
    const face = 3 * Math.floor(corner / 3);
    const [x, y, z] = [faces[face], faces[face + 1], faces[face + 2]];
    let drawn = first[vertex];
    for (; drawn >= 0; drawn = next[drawn]) {
      const [sx, sy, sz] = [sums[3 * drawn], sums[3 * drawn + 1], sums[3 * drawn + 2]];
      if (sx * x + sy * y + sz * z >= least * Math.hypot(sx, sy, sz)) break;
    }
    if (drawn < 0) {
      drawn = sources.push(vertex) - 1;
      sums.push(0, 0, 0);
      next.push(first[vertex]);
      first[vertex] = drawn;
    }
    const weight = areas[face / 3];
    sums[3 * drawn] += weight * x;
    sums[3 * drawn + 1] += weight * y;
    sums[3 * drawn + 2] += weight * z;
    index[corner] = drawn;
  }
  const normals = new Float32Array(sums.length);
  for (let i = 0; i < sums.length; i += 3) {
    const length = Math.hypot(sums[i], sums[i + 1], sums[i + 2]) || 1;
    for (let j = i; j < i + 3; j++) normals[j] = sums[j] / length;
  }
  return { sources: Uint32Array.from(sources), index, normals };
}

/**
 * Volume of a closed surface; negative if its triangles face inwards.
 *
 * @param {Float32Array} positions
 * @param {Uint32Array} triangles
 * @returns {number}
 */
function volume(positions, triangles) {
  let sum = 0;
  for (let i = 0; i < triangles.length; i += 3) {
    const [a, b, c] = [3 * triangles[i], 3 * triangles[i + 1], 3 * triangles[i + 2]];
    const [x, y, z] = [positions[a], positions[a + 1], positions[a + 2]];
    const [u, v, w] = [positions[b], positions[b + 1], positions[b + 2]];
    const [r, s, t] = [positions[c], positions[c + 1], positions[c + 2]];
    sum += x * (v * t - w * s) + y * (w * r - u * t) + z * (u * s - v * r);
  }
  return sum / 6;
}

// Width of the stripes of a hatching.
const STRIPE_PIXELS = 5;

/** Waves that run over the surface from where it was struck, as a part of its material. */
class Waves {
  constructor() {
    // x, y, z and seconds since the strike; strength.
    this.strikes = Array.from({ length: WAVES }, () => new THREE.Vector4(0, 0, 0, 1e3));
    this.strengths = new Float32Array(WAVES);
    this.next = 0;
    this.size = { value: 1 };
    this.running = { value: 0 };
  }

  /** @param {THREE.Vector3} point @param {number} strength */
  start(point, strength) {
    this.strikes[this.next].set(point.x, point.y, point.z, 0);
    this.strengths[this.next] = strength;
    this.next = (this.next + 1) % WAVES;
    this.running.value = WAVES;
  }

  /** @param {number} seconds since the last drawing @returns {boolean} whether any still runs */
  advance(seconds) {
    for (const strike of this.strikes) strike.w += seconds;
    const running = this.strikes.some((strike) => strike.w < WAVE_SECONDS);
    this.running.value = running ? WAVES : 0;
    return running;
  }

  /** @param {THREE.Material} material whose shader gets them */
  attach(material) {
    material.onBeforeCompile = (shader) => {
      Object.assign(shader.uniforms, {
        strikes: { value: this.strikes },
        strengths: { value: this.strengths },
        size: this.size,
        running: this.running,
      });
      shader.vertexShader = shader.vertexShader
        .replace("#include <common>", "#include <common>\nattribute float hatch;\nvarying vec3 here;\nvarying float hatched;")
        .replace("#include <begin_vertex>", "#include <begin_vertex>\nhere = position;\nhatched = hatch;");
      shader.fragmentShader = shader.fragmentShader
        .replace(
          "#include <common>",
          `#include <common>
          varying vec3 here;
          varying float hatched;
          uniform vec4 strikes[${WAVES}];
          uniform float strengths[${WAVES}];
          uniform float size;
          uniform int running;`,
        )
        .replace(
          "#include <opaque_fragment>",
          `if (hatched > 0.5) {
            // Stripes up to the right where it is held, down to the right where springs are.
            float along = hatched > 1.5 ? gl_FragCoord.x + gl_FragCoord.y : gl_FragCoord.x - gl_FragCoord.y;
            float stripe = step(0.5, fract(along / ${(2 * STRIPE_PIXELS).toFixed(1)}));
            outgoingLight = mix(outgoingLight, mix(vec3(1.0), vec3(0.02, 0.03, 0.04), stripe), 0.8);
          }
          for (int i = 0; i < running; i++) {
            float age = strikes[i].w / ${WAVE_SECONDS.toFixed(2)};
            if (age < 1.0) {
              float reach = size * (0.02 + 0.22 * sqrt(age)) * (0.5 + 0.5 * strengths[i]);
              float off = (distance(here, strikes[i].xyz) - reach) / (0.016 * size);
              float fade = (1.0 - age) * (0.45 + 0.55 * strengths[i]);
              // Light with a dark rim outside: seen on every colour of the map.
              outgoingLight = mix(outgoingLight, vec3(0.0), fade * 0.7 * exp(-(off - 1.6) * (off - 1.6)));
              outgoingLight = mix(outgoingLight, vec3(1.0), fade * exp(-off * off));
            }
          }
          #include <opaque_fragment>`,
        );
    };
  }
}

export class Surface {
  /**
   * @param {Float32Array} positions (V, 3) [m]
   * @param {Uint32Array} triangles (F, 3)
   */
  constructor(positions, triangles) {
    const { sources, index, normals } = creased(positions, triangles);
    this.positions = positions;
    this.sources = sources;
    const drawn = new Float32Array(3 * sources.length);
    for (let i = 0; i < sources.length; i++) {
      for (let j = 0; j < 3; j++) drawn[3 * i + j] = positions[3 * sources[i] + j];
    }
    this.geometry = new THREE.BufferGeometry();
    this.geometry.setIndex(new THREE.BufferAttribute(index, 1));
    this.geometry.setAttribute("position", new THREE.BufferAttribute(drawn, 3));
    this.geometry.setAttribute("normal", new THREE.BufferAttribute(normals, 3));
    const colours = new THREE.BufferAttribute(new Float32Array(3 * sources.length), 3);
    colours.setUsage(THREE.DynamicDrawUsage);
    this.geometry.setAttribute("color", colours);
    const hatch = new THREE.BufferAttribute(new Float32Array(sources.length), 1);
    this.geometry.setAttribute("hatch", hatch);
    this.geometry.computeBoundingSphere();
    this.waves = new Waves();
    this.waves.size.value = this.sphere.radius;
    const side = volume(positions, triangles) < 0 ? THREE.BackSide : THREE.FrontSide;
    this.material = new THREE.MeshLambertMaterial({ vertexColors: true, side });
    this.waves.attach(this.material);
    this.mesh = new THREE.Mesh(this.geometry, this.material);
  }

  /** @returns {THREE.Sphere} around all of it */
  get sphere() {
    return /** @type {THREE.Sphere} */ (this.geometry.boundingSphere);
  }

  /** @param {number} vertex of the solid @returns {THREE.Vector3} where it is [m] */
  at(vertex) {
    return new THREE.Vector3().fromArray(this.positions, 3 * vertex);
  }

  /** @param {THREE.Color} colour of a solid whose moduli are not known */
  paintBare(colour) {
    const colours = this.geometry.getAttribute("color");
    for (let i = 0; i < colours.count; i++) colours.setXYZ(i, colour.r, colour.g, colour.b);
    colours.needsUpdate = true;
  }

  /**
   * Writes the colours, and nothing else.
   *
   * @param {Float32Array} young moduli at the solid's vertices [Pa]
   * @param {[number, number]} spanned decadic logarithms of what the map's ends stand for
   */
  paint(young, spanned) {
    const colours = /** @type {THREE.BufferAttribute} */ (this.geometry.getAttribute("color"));
    paint(/** @type {Float32Array} */ (colours.array), young, this.sources, spanned);
    colours.needsUpdate = true;
  }

  /**
   * Writes a colour for each region.
   *
   * @param {ArrayLike<number>} regions numbers at the solid's vertices
   * @param {readonly THREE.Color[]} palette of the regions
   * @param {THREE.Color} bare of what is of none
   */
  paintRegions(regions, palette, bare) {
    const colours = this.geometry.getAttribute("color");
    for (let i = 0; i < colours.count; i++) {
      const { r, g, b } = palette[regions[this.sources[i]]] ?? bare;
      colours.setXYZ(i, r, g, b);
    }
    colours.needsUpdate = true;
  }

  /** @param {ArrayLike<number> | null} hatches 1 where the solid is held, 2 where springs are, at its vertices */
  hatch(hatches) {
    const attribute = this.geometry.getAttribute("hatch");
    for (let i = 0; i < attribute.count; i++) attribute.setX(i, hatches?.[this.sources[i]] ?? 0);
    attribute.needsUpdate = true;
  }

  dispose() {
    this.geometry.dispose();
    this.material.dispose();
  }
}
