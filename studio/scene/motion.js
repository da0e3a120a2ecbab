/** Where bodies are at any time, between the steps that a page holds. */

/**
 * @typedef {object} Track Where B bodies are at T times.
 * @property {number} step [s]
 * @property {number} count B
 * @property {Float32Array} positions (T, B, 3) [m]
 * @property {Float32Array} rotations (T, B, 4) Unit quaternions, their real part first.
 */

/**
 * @param {Track} track
 * @param {number} body
 * @param {number} seconds Before the first step it is there already, after the last one still.
 * @param {number[]} place Gets position (3) [m] and rotation (4), the real part first; written.
 * @returns {number[]} `place`
 */
export function placeAt({ step, count, positions, rotations }, body, seconds, place) {
  const last = positions.length / (3 * count) - 1;
  const along = Math.min(last, Math.max(0, seconds / step));
  const before = Math.floor(along);
  const share = along - before;
  const [p, q] = [before, Math.min(last, before + 1)].map((at) => 3 * (at * count + body));
  for (let i = 0; i < 3; i++) place[i] = (1 - share) * positions[p + i] + share * positions[q + i];
  const [r, s] = [(4 * p) / 3, (4 * q) / 3];
  let alike = 0;
  for (let i = 0; i < 4; i++) alike += rotations[r + i] * rotations[s + i];
  // A quaternion and its negative are one rotation: the nearer one is taken.
  const weight = alike < 0 ? -share : share;
  let square = 0;
  for (let i = 0; i < 4; i++) {
    place[3 + i] = (1 - share) * rotations[r + i] + weight * rotations[s + i];
    square += place[3 + i] ** 2;
  }
  for (let i = 3; i < 7; i++) place[i] /= Math.sqrt(square);
  return place;
}

/**
 * What a body's centre passes in all.
 *
 * @param {Track} track
 * @param {number} body
 * @returns {{low: number[], high: number[]}} (3) [m]
 */
export function extentOf({ count, positions }, body) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (let at = 3 * body; at < positions.length; at += 3 * count) {
    for (let i = 0; i < 3; i++) {
      low[i] = Math.min(low[i], positions[at + i]);
      high[i] = Math.max(high[i], positions[at + i]);
    }
  }
  return { low, high };
}
