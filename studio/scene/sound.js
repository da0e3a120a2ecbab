/** What is heard: the scene's own sound and what is struck by hand, and how far it has come. */

import { makeBank } from "../page/sound/bank.js";

/** @typedef {import("./content.js").Body} Body */

const FADE_SECONDS = 0.01;
/** Between the call and the first sample, which the thread of the sound card needs to hear of it. */
const AHEAD_SECONDS = 0.03;
const NO_DECODER = "This browser cannot read the scene's sound (FLAC), and plays the picture alone.";

export class SceneSound {
  /**
   * @param {import("./content.js").Scene} scene
   * @param {string} processorUrl Where `processor.js` is.
   */
  constructor(scene, processorUrl) {
    this.bank = makeBank({}, { processorUrl });
    /** A sentence if the scene's sound cannot be heard, else null. @type {string | null} */
    this.failure = null;
    /** @type {AudioBuffer | null} */
    this.buffer = null;
    const { context } = this.bank;
    this.loudness = context && new GainNode(context);
    /** @type {{source: AudioBufferSourceNode, fade: GainNode} | null} */
    this.playing = null;
    // Second of the scene that is heard at a second of the context, or of the page without one.
    this.from = 0;
    this.since = 0;
    /** Of each body's modes among all, which are those of one bank. @type {number[]} */
    this.firsts = [];
    this.count = 0;
    for (const { voice } of scene.bodies) {
      this.firsts.push(this.count);
      this.count += voice?.hertz.length ?? 0;
    }
    this.#takeModes(scene.bodies);
    /** Resolves when all is there, or failed to be. */
    this.ready = this.#begin(scene.sound);
  }

  /** @param {Body[]} bodies */
  #takeModes(bodies) {
    /** @param {"hertz" | "dampings"} name */
    const all = (name) => Float64Array.from(bodies.flatMap(({ voice }) => [...(voice?.[name] ?? [])]));
    const header = { targets: [], wanted_hertz: null, cents: null, bark: null };
    this.bank.take(
      { event: "bank", number: 0, surface: 0, fine: false, cost: null, rms_cents: null, ...header },
      {
        hertz: all("hertz"),
        dampings: all("dampings"),
        gains: new Float32Array(0),
        young: new Float32Array(0),
        struck: new Float64Array(0),
      },
    );
  }

  /** @param {ArrayBuffer} file */
  async #begin(file) {
    await this.bank.ready;
    const { context, output } = this.bank;
    this.failure = this.bank.failure;
    if (this.failure !== null || !context || !output || !this.loudness) return;
    const options = { outputChannelCount: [2], channelCount: 2 };
    const ears = new AudioWorkletNode(context, "carillon-ears", {
      ...options,
      channelCountMode: "explicit",
    });
    output.disconnect();
    output.connect(this.loudness).connect(ears).connect(context.destination);
    this.ears = ears;
    this.buffer = await context.decodeAudioData(file).catch(() => null);
    if (this.buffer === null) this.failure = NO_DECODER;
  }

  /** @returns {boolean} whether the browser still waits for a click before it lets the page sound */
  get waits() {
    return this.bank.state === "suspended";
  }

  /** Resolves once the browser lets the page sound, or where it never will. */
  async allowed() {
    await this.ready;
    this.bank.resume();
    if (!this.waits) return;
    await new Promise((resolve) => this.bank.onState(() => !this.waits && resolve(null)));
  }

  /**
   * Plays the scene; what it played before ends.
   *
   * @param {number} seconds From where.
   */
  play(seconds) {
    this.stop();
    const { context } = this.bank;
    this.from = seconds;
    this.since = performance.now() / 1000;
    if (!context || !this.buffer || !this.loudness) return;
    const source = new AudioBufferSourceNode(context, { buffer: this.buffer });
    const fade = new GainNode(context);
    source.connect(fade).connect(this.loudness);
    this.since = context.currentTime + AHEAD_SECONDS;
    source.onended = () => fade.disconnect();
    source.start(this.since, seconds);
    this.playing = { source, fade };
  }

  /** Ends the scene's sound; what was struck rings on. */
  stop() {
    if (!this.playing) return;
    const { source, fade } = this.playing;
    const now = source.context.currentTime;
    fade.gain.setTargetAtTime(0, now, FADE_SECONDS / 4);
    source.stop(now + FADE_SECONDS);
    this.playing = null;
  }

  /**
   * Second of the scene that the context plays at one of its own times.
   *
   * @param {number} contextSeconds
   * @returns {number}
   */
  playedAt(contextSeconds) {
    return this.from + contextSeconds - this.since;
  }

  /** Second of the scene that comes to the ear now; before its first sample, less than there it began. */
  get heard() {
    const { context } = this.bank;
    if (!this.playing || !context) return this.playedAt(performance.now() / 1000);
    const late = context.outputLatency || context.baseLatency || 0;
    return this.playedAt(context.currentTime - late);
  }

  /** Factor of all that sounds; 1 leaves samples as they are. */
  get volume() {
    return this.loudness?.gain.value ?? 1;
  }
  set volume(value) {
    const { context } = this.bank;
    if (context) this.loudness?.gain.setTargetAtTime(value, context.currentTime, FADE_SECONDS);
  }

  /**
   * Strikes a body along its inward normal.
   *
   * @param {Body} body
   * @param {number} vertex
   * @param {number} impulse [N s]
   * @returns {boolean} Whether it sounds.
   */
  strike({ number, voice }, vertex, impulse) {
    if (!voice || this.bank.failure !== null) return false;
    const gains = new Float64Array(this.count);
    for (let mode = 0; mode < voice.hertz.length; mode++) {
      gains[this.firsts[number] + mode] = impulse * voice.gainOf(vertex, mode);
    }
    return this.bank.strikeAt(gains, { contactSeconds: voice.contactSeconds });
  }
}
