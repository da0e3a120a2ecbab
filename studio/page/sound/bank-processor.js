// Sounds what rings, in the thread of the sound card.

import { Limiter } from "./limiter.js";
import { Bank } from "./ringing.js";

/** Modes of former materials that may still ring; beyond, the oldest material fades. */
const MOST_LEFT_RINGING = 4096;
const REPORTS_PER_SECOND = 30;

/** Lets the engine compile what the first strike would else wait for. */
function warmUp() {
  const count = 32;
  const out = new Float64Array(128);
  const [force, otherForce] = [new Float64Array(128), new Float64Array(128)];
  const bank = new Bank(new Float64Array(count).fill(440), new Float64Array(count), sampleRate);
  const limiter = new Limiter(sampleRate);
  for (let block = 0; block < 256; block++) {
    if (block % 2 === 0) bank.strike(new Float64Array(count).fill(1e-3), 0.001, block * 128);
    bank.addTo(out, block * 128, force, otherForce);
    limiter.limit(out);
  }
}

/** Sounds modes and what comes in beside them (clips, their noise), limited together. */
class BankProcessor extends AudioWorkletProcessor {
  /** @param {{processorOptions?: {messages?: import("../types.js").BankMessage[]}}} [options] */
  constructor(options) {
    super(options);
    /** @type {Bank[]} The present material's modes last. */
    this.banks = [];
    this.limiter = new Limiter(sampleRate);
    this.volume = 1;
    this.wantedVolume = 1;
    /** @type {Set<number> | null} */
    this.solo = null;
    /** @type {Set<number>} */
    this.muted = new Set();
    this.samples = new Float64Array(128);
    this.force = new Float64Array(128);
    this.otherForce = new Float64Array(128);
    this.peak = 0;
    this.limited = false;
    this.sinceReport = 0;
    this.quietReported = true;
    for (const message of options?.processorOptions?.messages ?? []) this.take(message);
    warmUp();
    this.port.onmessage = (event) => this.take(event.data);
  }

  /** @param {number} count Samples of a block. */
  resize(count) {
    this.samples = new Float64Array(count);
    this.force = new Float64Array(count);
    this.otherForce = new Float64Array(count);
  }

  /** @param {import("../types.js").BankMessage} message */
  take(message) {
    if (message.do === "bank") {
      this.banks.push(new Bank(message.hertz, message.dampings, sampleRate));
      this.weigh(true);
    } else if (message.do === "strike") {
      const at = message.at_seconds;
      const frame = at === undefined ? currentFrame : Math.max(currentFrame, at * sampleRate);
      this.banks.at(-1)?.strike(message.gains, message.contact_seconds ?? 0, frame);
    } else if (message.do === "heard") {
      this.solo = message.solo && new Set(message.solo);
      this.muted = new Set(message.muted);
      this.weigh(false);
    } else if (message.do === "volume") {
      this.wantedVolume = Math.max(0, message.volume);
    } else if (message.do === "silence") {
      for (const bank of this.banks) bank.silence();
    }
  }

  /**
   * Which modes are heard; they ring on in any case.
   *
   * @param {boolean} newest Whether the newest material alone gets its weights, without a ramp.
   */
  weigh(newest) {
    for (const bank of newest ? this.banks.slice(-1) : this.banks) {
      for (let k = 0; k < bank.count; k++) {
        const heard = this.solo === null ? !this.muted.has(k) : this.solo.has(k);
        bank.wantedWeight[k] = heard ? 1 : 0;
      }
      if (newest) bank.weight.set(bank.wantedWeight);
    }
  }

  /**
   * @param {Float32Array[][]} inputs
   * @param {Float32Array[][]} outputs
   * @returns {boolean}
   */
  process(inputs, outputs) {
    const out = outputs[0][0];
    const beside = inputs[0]?.[0];
    if (this.samples.length !== out.length) this.resize(out.length);
    const { samples } = this;
    if (beside) samples.set(beside);
    else samples.fill(0);
    let ringing = 0;
    for (const bank of this.banks) {
      if (bank.alive) bank.addTo(samples, currentFrame, this.force, this.otherForce);
      ringing += bank.nRinging;
    }
    this.forget(ringing);
    this.turnUp(samples);
    for (let i = 0; i < samples.length; i++) {
      this.peak = Math.max(this.peak, Math.abs(samples[i]));
    }
    if (this.limiter.limit(samples)) this.limited = true;
    out.set(samples);
    this.report(out.length, ringing);
    return true;
  }

  /** @param {number} ringing Modes that ring. */
  forget(ringing) {
    if (this.banks.length < 2) return;
    const present = this.banks[this.banks.length - 1];
    this.banks = this.banks.filter((bank) => bank === present || bank.alive);
    if (ringing - present.nRinging > MOST_LEFT_RINGING) this.banks[0].fade();
  }

  /** @param {Float64Array} samples */
  turnUp(samples) {
    if (this.volume === 1 && this.wantedVolume === 1) return;
    const step = (this.wantedVolume - this.volume) / samples.length;
    for (let i = 0; i < samples.length; i++) samples[i] *= this.volume + (i + 1) * step;
    this.volume = this.wantedVolume;
  }

  /**
   * @param {number} count Samples of the block.
   * @param {number} ringing
   */
  report(count, ringing) {
    this.sinceReport += count;
    if (this.sinceReport * REPORTS_PER_SECOND < sampleRate) return;
    const quiet = this.peak === 0 && ringing === 0;
    if (!quiet || !this.quietReported) {
      this.port.postMessage({ peak: this.peak, ringing, limited: this.limited });
    }
    this.quietReported = quiet;
    this.sinceReport = 0;
    this.peak = 0;
    this.limited = false;
  }
}

registerProcessor("carillon-bank", BankProcessor);
