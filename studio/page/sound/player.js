// Plays clips and their parts, one at a time, and several in turn.

/**
 * What is played: the address of a sound, a file, samples that are there already, or something that
 * sounds by itself and says how long it takes [s].
 *
 * @typedef {string | Blob | AudioBuffer | (() => number)} Piece
 *
 * @typedef {ReturnType<typeof makePlayer>} Player
 */

const GAP_SECONDS = 0.25;
const FADE_SECONDS = 0.01;

/**
 * Makes a player whose sounds go through the bank's limiter and volume.
 *
 * @param {{bank: import("./bank.js").Bank}} parts
 */
export function makePlayer({ bank }) {
  /** @type {{stop: () => void} | null} */
  let present = null;
  /** @type {((name: string | null) => void)[]} */
  const listeners = [];

  /** @param {string | null} name */
  function tell(name) {
    for (const listener of listeners) listener(name);
  }

  /**
   * @param {AudioBuffer} buffer
   * @param {AbortSignal} signal
   * @returns {Promise<void>}
   */
  function sound(buffer, signal) {
    const { context, input } = bank;
    if (!context || !input) return Promise.resolve();
    const source = new AudioBufferSourceNode(context, { buffer });
    const fade = new GainNode(context);
    source.connect(fade).connect(input);
    return new Promise((resolve) => {
      source.onended = () => {
        fade.disconnect();
        resolve();
      };
      signal.addEventListener("abort", () => {
        fade.gain.setTargetAtTime(0, context.currentTime, FADE_SECONDS / 4);
        source.stop(context.currentTime + FADE_SECONDS);
      });
      source.start();
    });
  }

  /**
   * Plays pieces one after the other; what played before ends.
   *
   * @param {Piece[]} pieces
   * @param {object} [options]
   * @param {string} [options.name] Told to listeners while it plays.
   * @param {number} [options.gapSeconds] Silence between two pieces.
   * @returns {Promise<boolean>} Whether it came to its end; false if something else was played.
   */
  async function playInTurn(pieces, { name = "", gapSeconds = GAP_SECONDS } = {}) {
    if (bank.failure !== null) throw new Error(bank.failure);
    present?.stop();
    const control = new AbortController();
    const { signal } = control;
    const own = { stop: () => control.abort() };
    present = own;
    bank.resume();
    tell(name);
    try {
      const loaded = await Promise.all(pieces.map((piece) => load(bank.context, piece, signal)));
      for (const [number, piece] of loaded.entries()) {
        if (signal.aborted) break;
        if (number > 0) await pause(gapSeconds, signal);
        if (signal.aborted) break;
        if (typeof piece === "function") await pause(piece(), signal);
        else await sound(piece, signal);
      }
    } catch (error) {
      if (!signal.aborted) throw error;
    } finally {
      if (present === own) {
        present = null;
        tell(null);
      }
    }
    return !signal.aborted;
  }

  return {
    /**
     * Plays one piece; what played before ends.
     *
     * @param {Piece} piece
     * @param {{name?: string}} [options]
     * @returns {Promise<boolean>} See `playInTurn`.
     */
    play(piece, options = {}) {
      return playInTurn([piece], { name: typeof piece === "string" ? piece : "", ...options });
    },

    playInTurn,

    /** Ends what plays. */
    stop() {
      present?.stop();
    },

    /** Whether something plays. */
    get playing() {
      return present !== null;
    },

    /** @param {(name: string | null) => void} listener Called with what begins, null at the end. */
    onChange(listener) {
      listeners.push(listener);
    },
  };
}

/**
 * Samples of a sound at an address.  Rejects with a sentence.
 *
 * @param {BaseAudioContext} context
 * @param {string} url
 * @param {AbortSignal} [signal]
 * @returns {Promise<AudioBuffer>}
 */
export async function fetchSound(context, url, signal) {
  const answer = await fetch(url, { signal });
  if (!answer.ok) {
    const said = await answer.json().catch(() => ({}));
    throw new Error(said.error ?? `There is no such sound (${answer.status}).`);
  }
  return decode(context, await answer.arrayBuffer());
}

/**
 * @param {BaseAudioContext} context
 * @param {ArrayBuffer} bytes
 * @returns {Promise<AudioBuffer>}
 */
async function decode(context, bytes) {
  try {
    return await context.decodeAudioData(bytes);
  } catch {
    throw new Error("The browser cannot play this sound; listen to it as WAV.");
  }
}

/**
 * @param {AudioContext | null} context
 * @param {Piece} piece
 * @param {AbortSignal} signal
 * @returns {Promise<AudioBuffer | (() => number)>}
 */
async function load(context, piece, signal) {
  if (typeof piece === "function" || piece instanceof AudioBuffer) return piece;
  if (!context) throw new Error("This browser cannot play sounds.");
  if (piece instanceof Blob) return decode(context, await piece.arrayBuffer());
  return fetchSound(context, piece, signal);
}

/**
 * @param {number} seconds
 * @param {AbortSignal} signal
 * @returns {Promise<void>}
 */
function pause(seconds, signal) {
  return new Promise((resolve) => {
    const timer = setTimeout(resolve, 1000 * seconds);
    signal.addEventListener("abort", () => {
      clearTimeout(timer);
      resolve();
    });
  });
}
