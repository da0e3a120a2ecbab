/** What a page holds of a design, in the shapes that the studio's page uses. */

/**
 * @typedef {object} Design
 * @property {string} name
 * @property {{name: string, vertex: number}[]} targets
 * @property {number} rmsCents
 * @property {(number | null)[]} cents (N) Of each mode, above the clips'; null if it shall stay silent.
 * @property {import("../page/types.js").BankHeader} header
 * @property {import("../page/types.js").BankArrays} bank
 * @property {{hertz: Float64Array, dampings: Float64Array, amplitudes: number[][]}} wanted Modes of
 *     the clips; amplitudes have a row for each target.
 * @property {Float32Array} positions (V, 3) [m]
 * @property {Uint32Array} triangles (F, 3)
 */

/** @param {number} bits @returns {number} of a number of half precision */
export function fromHalf(bits) {
  const exponent = (bits >> 10) & 31;
  const fraction = bits & 1023;
  const size = exponent === 0 ? fraction * 2 ** -24 : (1 + fraction / 1024) * 2 ** (exponent - 15);
  return bits & 0x8000 ? -size : size;
}

/**
 * @param {import("../page/connection.js").Numbers} places (3, V) Steps, one axis after the other.
 * @param {number[]} origin [m]
 * @param {number} step [m]
 * @returns {Float32Array} (V, 3) [m]
 */
export function positionsOf(places, origin, step) {
  const vertices = places.length / 3;
  const positions = new Float32Array(places.length);
  for (let axis = 0; axis < 3; axis++) {
    for (let vertex = 0; vertex < vertices; vertex++) {
      positions[3 * vertex + axis] = origin[axis] + places[axis * vertices + vertex] * step;
    }
  }
  return positions;
}

/**
 * Reads gains of half precision, whose low bytes all come first, then all high ones.
 *
 * @param {import("../page/connection.js").Numbers} halves (N V) One mode after the other.
 * @param {import("../page/connection.js").Numbers} loudest (N)
 * @returns {(vertex: number, mode: number) => number}
 */
export function gainsOf({ buffer, byteOffset, byteLength, length }, loudest) {
  const bytes = new Uint8Array(buffer, byteOffset, byteLength);
  const vertices = length / loudest.length;
  return (vertex, mode) => {
    const at = mode * vertices + vertex;
    return fromHalf(bytes[at] | (bytes[length + at] << 8)) * loudest[mode];
  };
}

/**
 * @param {any} header
 * @param {import("../page/connection.js").Arrays} arrays
 * @returns {Design}
 */
export function readDesign(header, arrays) {
  const hertz = /** @type {Float64Array} */ (arrays.hertz);
  const [modes, vertices] = [hertz.length, arrays.young.length];
  const gains = new Float32Array(vertices * modes);
  const gainOf = gainsOf(arrays.halves, arrays.loudest);
  for (let mode = 0; mode < modes; mode++) {
    for (let vertex = 0; vertex < vertices; vertex++) {
      gains[vertex * modes + mode] = gainOf(vertex, mode);
    }
  }
  const [least, step] = header.young_log10_pa;
  const wanted = /** @type {Float64Array} */ (arrays.wanted_hertz);
  return {
    name: header.name,
    targets: header.targets,
    rmsCents: header.rms_cents,
    cents: header.cents,
    header: {
      event: "bank",
      number: 0,
      surface: 0,
      fine: false,
      cost: null,
      rms_cents: header.rms_cents,
      targets: header.targets.map((/** @type {{name: string}} */ { name }) => name),
      // Modes that shall stay silent have none.
      wanted_hertz: Array.from(wanted, (hertz, mode) => (header.cents[mode] === null ? null : hertz)),
      cents: header.cents,
      bark: null,
    },
    bank: {
      hertz,
      dampings: /** @type {Float64Array} */ (arrays.dampings),
      gains,
      young: Float32Array.from(arrays.young, (steps) => 10 ** (least + steps * step)),
      struck: new Float64Array(0),
    },
    wanted: {
      hertz: wanted,
      dampings: /** @type {Float64Array} */ (arrays.wanted_dampings),
      amplitudes: header.amplitudes,
    },
    positions: positionsOf(arrays.places, header.origin_m, header.step_m),
    triangles: Uint32Array.from(arrays.triangles),
  };
}

/**
 * What modes sound with after a strike of 1 N s.
 *
 * @param {Design} design
 * @param {number} vertex
 * @returns {Float32Array} (N)
 */
export function gainsAt(design, vertex) {
  const count = design.bank.hertz.length;
  return design.bank.gains.subarray(vertex * count, (vertex + 1) * count);
}
