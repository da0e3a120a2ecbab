// The page's side of the modes that ring: takes what the solid sounds like and strikes it at once.

/**
 * @typedef {import("../types.js").BankHeader} BankHeader
 * @typedef {import("../types.js").BankArrays} BankArrays
 * @typedef {import("../types.js").BankMessage} BankMessage
 * @typedef {import("../types.js").BankReport} BankReport
 *
 * @typedef {object} StrikeOptions
 * @property {number} [contactSeconds] Duration of the force, half a sine; 0 is an impulse.
 * @property {number} [atSeconds] Time of the context; without it at once.
 *
 * @typedef {object} Struck What is told of a strike.
 * @property {number | null} vertex Of the surface; null if gains were given.
 * @property {number} strength [N s]
 * @property {number | undefined} atSeconds As in the options.
 *
 * @typedef {ReturnType<typeof makeBank>} Bank
 */

export const NO_SOUND =
  "This browser has no AudioWorklet here, so nothing sounds; open the page in a current browser, " +
  "at an address that begins with http://127.0.0.1 or https.";

/**
 * Makes the sound of the page.  It may be struck from the first moment; before the browser lets
 * pages sound, which is at the first click or key, strikes are kept.
 *
 * @param {{connection?: import("../connection.js").Connection}} [parts] Where banks come from.
 * @param {object} [options]
 * @param {string} [options.processorUrl] Where `bank-processor.js` is.
 * @param {AudioContextLatencyCategory | number} [options.latencyHint]
 */
export function makeBank(parts = {}, options = {}) {
  const { latencyHint = 0 } = options;
  const processorUrl = options.processorUrl ?? new URL("bank-processor.js", import.meta.url).href;
  const context = "AudioContext" in window ? new AudioContext({ latencyHint }) : null;
  /** @type {GainNode | null} What comes in here is limited together with the modes. */
  const input = context && new GainNode(context);
  /** @type {AudioWorkletNode | null} */
  let node = null;
  /** @type {BankMessage[]} What was said before the processor was there. */
  let early = [];
  /** @type {BankMessage | null} The newest material, while nothing can be heard of it. */
  let waiting = null;
  /** @type {{header: BankHeader, arrays: BankArrays} | null} */
  let current = null;
  /** @type {BankReport} */
  let report = { peak: 0, ringing: 0, limited: false };
  /** @type {string | null} */
  let failure = null;
  /** @type {((struck: Struck) => void)[]} */
  const strikeListeners = [];
  /** @type {(() => void)[]} */
  const stateListeners = [];
  /** @type {number[] | null} */
  let solo = null;
  /** @type {number[]} */
  let muted = [];
  let volume = 1;
  let contactSeconds = 0;

  /** @param {BankMessage} message */
  function tell(message) {
    if (waiting && message.do === "strike") tellWaiting();
    if (node) node.port.postMessage(message);
    else if (failure === null) early.push(message);
  }

  function tellWaiting() {
    const message = waiting;
    waiting = null;
    if (message) tell(message);
  }

  function tellState() {
    if (context?.state === "running") tellWaiting();
    for (const listener of stateListeners) listener();
  }

  function resume() {
    if (context && context.state !== "running" && context.state !== "closed") {
      // Before the first gesture the browser refuses, or waits; the next gesture asks again.
      context.resume().catch(() => {});
    }
  }

  async function begin() {
    if (!context || !input || !context.audioWorklet) throw new Error(NO_SOUND);
    await context.audioWorklet.addModule(processorUrl);
    node = makeNode(context, early);
    early = [];
    node.port.onmessage = (event) => {
      report = event.data;
    };
    node.onprocessorerror = () => {
      failure = "The sound stopped by an error of its own; load the page again.";
      tellState();
    };
    input.connect(node).connect(context.destination);
  }

  const ready = begin().catch((error) => {
    failure = context?.audioWorklet ? `Nothing sounds: ${error.message}` : NO_SOUND;
    early = [];
  });
  ready.then(tellState);
  context?.addEventListener("statechange", tellState);
  const gestures = ["pointerdown", "pointerup", "keydown"];
  for (const name of gestures) document.addEventListener(name, resume, true);

  /**
   * @param {number | null} vertex
   * @param {Float64Array} gains
   * @param {number} strength
   * @param {StrikeOptions} options
   */
  function send(vertex, gains, strength, { contactSeconds: contact = contactSeconds, atSeconds }) {
    tell({ do: "strike", gains, contact_seconds: contact, at_seconds: atSeconds });
    if (context?.state !== "running") resume();
    for (const listener of strikeListeners) listener({ vertex, strength, atSeconds });
  }

  /**
   * Takes a new material; what rings of the old one rings out.
   *
   * @param {BankHeader} header
   * @param {BankArrays} arrays
   */
  function take(header, arrays) {
    const before = current?.arrays;
    current = { header, arrays };
    const same =
      before && equal(before.hertz, arrays.hertz) && equal(before.dampings, arrays.dampings);
    if (same) return;
    // A search goes on for hours, even if nobody lets the page sound: materials must not pile up.
    waiting = { do: "bank", hertz: arrays.hertz, dampings: arrays.dampings };
    if (node && context?.state === "running") tellWaiting();
  }

  parts.connection?.onBinary("bank", (header, arrays) =>
    take(header, /** @type {BankArrays} */ (/** @type {unknown} */ (arrays))),
  );

  return {
    context,
    input,
    /** Where all that sounds comes out; null before `ready`. */
    get output() {
      return node;
    },

    /** Resolves when the processor is there, or failed to be. */
    ready,

    /** The solid as it sounds now; null before there is one. */
    get current() {
      return current;
    },

    /** A sentence if nothing can sound, else null. */
    get failure() {
      return failure;
    },

    take,

    /**
     * Strikes a vertex along its inward normal.
     *
     * @param {number} vertex
     * @param {number} [strength] [N s]; 1 sounds as loud as the clip.
     * @param {StrikeOptions} [options]
     * @returns {boolean} Whether there is such a vertex.
     */
    strike(vertex, strength = 1, options = {}) {
      if (!current) return false;
      const { gains, hertz } = current.arrays;
      const count = hertz.length;
      const row = gains.subarray(vertex * count, (vertex + 1) * count);
      if (!Number.isInteger(vertex) || row.length !== count || count === 0) return false;
      send(vertex, Float64Array.from(row, (gain) => gain * strength), strength, options);
      return true;
    },

    /**
     * Strikes with any gains.
     *
     * @param {ArrayLike<number>} gains (N) What the modes sound with [full scale].
     * @param {StrikeOptions} [options]
     * @returns {boolean} Whether there are as many modes.
     */
    strikeAt(gains, options = {}) {
      if (!current || gains.length !== current.arrays.hertz.length) return false;
      send(null, Float64Array.from(gains), 1, options);
      return true;
    },

    /**
     * Lets some modes be heard alone, others ring on unheard.
     *
     * @param {number[] | null} numbers Of modes, from 0; null lets all be heard.
     */
    solo(numbers) {
      solo = numbers && [...numbers];
      tell({ do: "heard", solo, muted });
    },

    /** @param {number[]} numbers Of modes, from 0, that are not heard. */
    mute(numbers) {
      muted = [...numbers];
      tell({ do: "heard", solo, muted });
    },

    /** Ends all that rings. */
    silence() {
      tell({ do: "silence" });
    },

    /** Factor of all that sounds; 1 leaves samples as they are. */
    get volume() {
      return volume;
    },
    set volume(value) {
      volume = Math.max(0, value);
      tell({ do: "volume", volume });
    },

    /** Duration of the force of strikes that do not tell their own. */
    get contactSeconds() {
      return contactSeconds;
    },
    set contactSeconds(value) {
      contactSeconds = Math.min(1, Math.max(0, value));
    },

    /**
     * What sounds: peak before the limiter (full scale is 1), modes that ring, whether it limited.
     *
     * @returns {BankReport}
     */
    level() {
      return report;
    },

    /** `running`, or why nothing is heard: `suspended` until a click or key, `closed`, `failed`. */
    get state() {
      return failure !== null ? "failed" : (context?.state ?? "failed");
    },

    /** From a sample to the ear, as far as the browser knows. */
    get latency() {
      return {
        baseSeconds: context?.baseLatency ?? 0,
        outputSeconds: context?.outputLatency ?? 0,
      };
    },

    resume,

    /** @param {(struck: Struck) => void} listener Called after each strike. */
    onStrike(listener) {
      strikeListeners.push(listener);
    },

    /** @param {() => void} listener Called when `state` has changed. */
    onState(listener) {
      stateListeners.push(listener);
    },

    /** Ends the sound of the page for good. */
    async close() {
      for (const name of gestures) document.removeEventListener(name, resume, true);
      await context?.close();
    },
  };
}

/**
 * The processor as a node, once `bank-processor.js` was added to the context.
 *
 * @param {BaseAudioContext} context
 * @param {BankMessage[]} [messages] What it is told before its first sample.
 * @returns {AudioWorkletNode}
 */
export function makeNode(context, messages = []) {
  return new AudioWorkletNode(context, "carillon-bank", {
    numberOfInputs: 1,
    numberOfOutputs: 1,
    outputChannelCount: [1],
    channelCount: 1,
    channelCountMode: "explicit",
    processorOptions: { messages },
  });
}

/**
 * @param {ArrayLike<number>} one
 * @param {ArrayLike<number>} other
 * @returns {boolean}
 */
function equal(one, other) {
  if (one.length !== other.length) return false;
  for (let i = 0; i < one.length; i++) if (one[i] !== other[i]) return false;
  return true;
}
