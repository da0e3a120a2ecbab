/** What a page holds of a scene, in the shapes that its parts use. */

import { gainsOf, positionsOf } from "../standalone/design.js";

/**
 * @typedef {object} Voice
 * @property {Float64Array} hertz (N)
 * @property {Float64Array} dampings (N) [1/s]
 * @property {(vertex: number, mode: number) => number} gainOf What a mode sounds with after 1 N s.
 * @property {number} impulse [N s] Of a strike by hand.
 * @property {number} contactSeconds
 * @property {number | null} expectedCents Expected error of the frequencies (rms); null if nothing is known.
 *
 * @typedef {object} Body An object of the scene.
 * @property {number} number
 * @property {string} name
 * @property {[number, number, number]} colour Red, green and blue from 0 to 1 (sRGB).
 * @property {Float32Array} positions (V, 3) [m] From its centre of mass.
 * @property {Uint32Array} triangles (F, 3)
 * @property {Voice | null} voice null for one that is silent.
 *
 * @typedef {object} Impact
 * @property {number} seconds
 * @property {[number, number]} pair Numbers of bodies, `GROUND` for the ground.
 * @property {[number, number, number]} place [m]
 * @property {number} impulse [N s]
 * @property {number} duration [s]
 *
 * @typedef {object} Scene
 * @property {string} title
 * @property {number} seconds How long it takes.
 * @property {number | null} ground Its height [m].
 * @property {{position: number[], target: number[], degrees: number}} camera [m]
 * @property {import("./motion.js").Track} track
 * @property {Body[]} bodies
 * @property {Impact[]} impacts In the order of time.
 * @property {ArrayBuffer} sound A file of FLAC.
 */

/** Number of the ground among the bodies. */
export const GROUND = 65535;

/**
 * @param {any} header
 * @param {import("../page/connection.js").Arrays} arrays
 * @returns {Scene}
 */
export function readScene(header, arrays) {
  const { position_m: position, target_m: target, degrees } = header.camera;
  const { buffer, byteOffset } = arrays.sound;
  return {
    title: header.title,
    seconds: header.seconds,
    ground: header.ground_m,
    camera: { position, target, degrees },
    track: {
      step: header.step_s,
      count: header.objects.length,
      positions: /** @type {Float32Array} */ (arrays.moved),
      rotations: /** @type {Float32Array} */ (arrays.turned),
    },
    bodies: header.objects.map((/** @type {any} */ told, /** @type {number} */ number) =>
      readBody(told, number, arrays),
    ),
    impacts: readImpacts(arrays),
    sound: /** @type {ArrayBuffer} */ (buffer.slice(byteOffset, byteOffset + header.sound_bytes)),
  };
}

/**
 * @param {any} told
 * @param {number} number
 * @param {import("../page/connection.js").Arrays} arrays
 * @returns {Body}
 */
function readBody(told, number, arrays) {
  /** @param {string} name */
  const own = (name) => arrays[`${name}_${number}`];
  const hertz = /** @type {Float64Array | undefined} */ (own("hertz"));
  return {
    number,
    name: told.name,
    colour: told.colour,
    positions: positionsOf(own("places"), told.origin_m, told.step_m),
    triangles: Uint32Array.from(own("triangles")),
    voice: hertz
      ? {
          hertz,
          dampings: /** @type {Float64Array} */ (own("dampings")),
          gainOf: gainsOf(own("halves"), own("loudest")),
          impulse: told.impulse_ns,
          contactSeconds: told.contact_s,
          expectedCents: told.expected_cents,
        }
      : null,
  };
}

/**
 * @param {import("../page/connection.js").Arrays} arrays
 * @returns {Impact[]}
 */
function readImpacts(arrays) {
  const { impact_pairs: pairs, impact_places: places } = arrays;
  return Array.from(arrays.impact_seconds, (seconds, i) => ({
    seconds,
    pair: [pairs[2 * i], pairs[2 * i + 1]],
    place: [places[3 * i], places[3 * i + 1], places[3 * i + 2]],
    impulse: arrays.impact_impulses[i],
    duration: arrays.impact_durations[i],
  }));
}

/**
 * How many impacts have begun.
 *
 * @param {Impact[]} impacts In the order of time.
 * @param {number} seconds
 * @returns {number}
 */
export function begun(impacts, seconds) {
  let [low, high] = [0, impacts.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (impacts[middle].seconds <= seconds) low = middle + 1;
    else high = middle;
  }
  return low;
}
