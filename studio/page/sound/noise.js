// What is noise in the clips, which goes along with strikes near their targets.

import { fetchSound } from "./player.js";

/**
 * @typedef {import("../types.js").State} State
 * @typedef {{position_m: ArrayLike<number>, clip: string}} Source A target that has a clip.
 * @typedef {ReturnType<typeof makeNoise>} Noise
 */

/**
 * Weights of points by the inverse square of their distance; 1 for the point itself.
 *
 * @param {ArrayLike<number>[]} points (3) each [m].
 * @param {ArrayLike<number>} position (3) [m]
 * @returns {number[]}
 */
export function weightsAt(points, position) {
  const squares = points.map(
    (point) =>
      (point[0] - position[0]) ** 2 + (point[1] - position[1]) ** 2 + (point[2] - position[2]) ** 2,
  );
  const nearest = Math.min(...squares);
  // Positions of a surface have single precision, those of targets have not.
  const size = Math.max(...Array.from(position, Math.abs));
  if (nearest <= (1e-6 * size) ** 2) return squares.map((square) => (square === nearest ? 1 : 0));
  const inverse = squares.map((square) => nearest / square);
  const sum = inverse.reduce((all, value) => all + value, 0);
  return inverse.map((value) => value / sum);
}

/**
 * Lets noise go along with strikes of the bank, once it is switched on.
 *
 * @param {object} parts
 * @param {import("./bank.js").Bank} parts.bank
 * @param {import("../state.js").ServerState} parts.state
 * @param {import("../connection.js").Connection} parts.connection
 */
export function makeNoise({ bank, state, connection }) {
  let on = false;
  /** @type {number | null} The surface whose vertices these are. */
  let surface = null;
  /** @type {Float32Array | null} (V, 3) [m] */
  let positions = null;
  /** @type {Source[]} */
  let sources = [];
  /** @type {Map<string, Promise<AudioBuffer | null>>} */
  const noises = new Map();
  /** @type {Map<string, AudioBuffer>} Those that are there: a strike waits for none. */
  const there = new Map();
  /** @type {string} What the clips are made of; noise is fetched anew when it changes. */
  let made = "";

  async function fetchPositions() {
    const wanted = state.current?.solid?.surface ?? null;
    if (wanted === surface) return;
    surface = wanted;
    positions = null;
    if (wanted === null) return;
    try {
      const { arrays } = await connection.binary(`/surface/${wanted}`);
      if (surface === wanted) positions = /** @type {Float32Array} */ (arrays.positions);
    } catch {
      if (surface === wanted) surface = null;
    }
  }

  function fetchAll() {
    const { context } = bank;
    if (!on || !context) return;
    fetchPositions();
    for (const { clip } of sources) {
      if (noises.has(clip)) continue;
      const fetched = fetchSound(context, `/clip/${clip}/noise`).then(
        (buffer) => {
          if (noises.get(clip) === fetched) there.set(clip, buffer);
          return buffer;
        },
        () => {
          // Without its noise a strike still sounds; the next change of the clips asks again.
          if (noises.get(clip) === fetched) noises.delete(clip);
          return null;
        },
      );
      noises.set(clip, fetched);
    }
  }

  /** @param {State} now */
  function follow(now) {
    const ready = new Map(
      now.clips.filter((clip) => clip.phase === "ready").map((clip) => [clip.clip, clip.modes]),
    );
    sources = now.targets.flatMap(({ position_m, clip }) =>
      clip !== null && ready.has(clip) ? [{ position_m, clip }] : [],
    );
    const without = now.targets.map((target) => target.without);
    const next = JSON.stringify([[...ready], without]);
    if (next !== made) {
      made = next;
      noises.clear();
      there.clear();
    }
    fetchAll();
  }

  state.onChange(follow);

  bank.onStrike(({ vertex, strength, atSeconds }) => {
    const { context, input } = bank;
    if (!on || vertex === null || !positions || sources.length === 0) return;
    if (!context || !input) return;
    const position = positions.subarray(3 * vertex, 3 * vertex + 3);
    const weights = weightsAt(sources.map((source) => source.position_m), position);
    for (const [number, { clip }] of sources.entries()) {
      const buffer = there.get(clip);
      if (!buffer || weights[number] === 0) continue;
      const gain = new GainNode(context, { gain: weights[number] * strength });
      const source = new AudioBufferSourceNode(context, { buffer });
      source.connect(gain).connect(input);
      source.onended = () => gain.disconnect();
      source.start(atSeconds ?? 0);
    }
  });

  return {
    /** Whether it sounds. */
    get on() {
      return on;
    },
    set on(value) {
      on = value;
      fetchAll();
    },

    /** Resolves when all noise that is wanted is there. */
    async loaded() {
      await Promise.all(noises.values());
    },
  };
}
