// Records a clip by the microphone, raw: what browsers do for speech would change the modes.

import { wavBlob } from "./wav.js";

export const LONGEST_SECONDS = 10;

/** @type {{[name: string]: string}} What went wrong, by the name of the browser's error. */
const REASONS = {
  NotAllowedError:
    "The browser does not let this page use the microphone; allow it beside the address.",
  NotFoundError: "There is no microphone; plug one in, or open a file.",
  NotReadableError: "The microphone is in use by another program; close that one.",
};

/** @typedef {ReturnType<typeof makeRecorder>} Recorder */

/**
 * Makes a recorder.
 *
 * @param {object} [_parts] Others of the page, of which it needs none.
 * @param {object} [options]
 * @param {string} [options.processorUrl] Where `recorder-processor.js` is.
 */
export function makeRecorder(_parts = {}, options = {}) {
  const processorUrl =
    options.processorUrl ?? new URL("recorder-processor.js", import.meta.url).href;
  /** @type {{context: AudioContext, stream: MediaStream} | null} */
  let open = null;
  /** @type {Float32Array[][]} Blocks, each of some channels. */
  let blocks = [];
  let frames = 0;
  let rate = 0;
  let peak = 0;
  let starting = false;
  /** @type {((blob: Blob) => void)[]} */
  const fullListeners = [];

  /** @param {Float32Array[]} channels */
  function take(channels) {
    if (!open) return;
    const left = LONGEST_SECONDS * rate - frames;
    const block = channels.map((samples) => samples.subarray(0, left));
    for (const sample of block[0]) peak = Math.max(peak, Math.abs(sample));
    blocks.push(block);
    frames += block[0].length;
    if (frames >= LONGEST_SECONDS * rate) {
      const blob = finish();
      for (const listener of fullListeners) listener(blob);
    }
  }

  function release() {
    for (const track of open?.stream.getTracks() ?? []) track.stop();
    open?.context.close();
    open = null;
  }

  /** @returns {Blob} */
  function finish() {
    release();
    // A microphone that changes its channels on the way is heard by those that it has all the time.
    const count = Math.min(...blocks.map((block) => block.length));
    const channels = Array.from({ length: count }, (_, channel) => {
      const samples = new Float32Array(frames);
      let at = 0;
      for (const block of blocks) {
        samples.set(block[channel], at);
        at += block[channel].length;
      }
      return samples;
    });
    blocks = [];
    return wavBlob(channels, rate);
  }

  return {
    /** Whether it records. */
    get recording() {
      return open !== null;
    },

    /** How long it has recorded [s]. */
    get seconds() {
      return rate > 0 ? frames / rate : 0;
    },

    /** When it ends by itself [s]. */
    longestSeconds: LONGEST_SECONDS,

    /**
     * Asks for the microphone and begins.  Rejects with a sentence.
     *
     * @returns {Promise<void>}
     */
    async start() {
      if (open || starting) throw new Error("It records already; stop it first.");
      if (!navigator.mediaDevices?.getUserMedia) {
        throw new Error(
          "This browser gives pages no microphone here; open the page at an address that begins " +
            "with http://127.0.0.1 or https.",
        );
      }
      starting = true;
      try {
        const stream = await navigator.mediaDevices.getUserMedia({
          audio: {
            echoCancellation: false,
            noiseSuppression: false,
            autoGainControl: false,
            channelCount: { ideal: 2 },
          },
        });
        try {
          await listen(stream);
        } catch (error) {
          for (const track of stream.getTracks()) track.stop();
          throw error;
        }
      } catch (error) {
        const { name, message } = /** @type {Error} */ (error);
        throw new Error(REASONS[name] ?? `Recording failed: ${message}`);
      } finally {
        starting = false;
      }
    },

    /**
     * Ends, and gives what was recorded: a WAV file.
     *
     * @returns {Promise<Blob>}
     */
    async stop() {
      if (!open) throw new Error("Nothing is being recorded; start first.");
      if (frames === 0) {
        release();
        throw new Error("The microphone gave no sound at all; try again.");
      }
      return finish();
    },

    /** Ends, and forgets what was recorded. */
    cancel() {
      release();
      blocks = [];
      frames = 0;
    },

    /** Largest magnitude since the last call; full scale is 1, which is clipped. */
    level() {
      const found = peak;
      peak = 0;
      return found;
    },

    /** @param {(blob: Blob) => void} listener Called when it has ended by itself. */
    onFull(listener) {
      fullListeners.push(listener);
    },
  };

  /** @param {MediaStream} stream */
  async function listen(stream) {
    // The microphone's own rate, so that nothing is resampled.
    const own = stream.getAudioTracks()[0]?.getSettings().sampleRate;
    const context = new AudioContext(own ? { sampleRate: own } : {});
    try {
      await context.audioWorklet.addModule(processorUrl);
      await context.resume();
      const source = new MediaStreamAudioSourceNode(context, { mediaStream: stream });
      const node = new AudioWorkletNode(context, "carillon-recorder", { numberOfOutputs: 1 });
      node.port.onmessage = (event) => take(event.data);
      blocks = [];
      frames = 0;
      peak = 0;
      rate = context.sampleRate;
      // Its output is silence; without a way to the destination nothing would be asked of it.
      source.connect(node).connect(context.destination);
      open = { context, stream };
    } catch (error) {
      await context.close();
      throw error;
    }
  }
}
