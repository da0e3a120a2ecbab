// What rings of struck solids, and what keeps it within full scale together with the scene's sound.

import "../page/sound/bank-processor.js";
import { Limiter } from "../page/sound/limiter.js";

/** Below it samples are as good as none, and what they are multiplied by need not be known. */
const LEAST_MAGNITUDE = 1e-9;

/** Limits two ears alike, so that what is heard stays where it is. */
class EarsProcessor extends AudioWorkletProcessor {
  constructor() {
    super();
    this.limiter = new Limiter(sampleRate);
    this.magnitudes = new Float64Array(128);
    this.before = new Float64Array(128);
  }

  /**
   * @param {Float32Array[][]} inputs
   * @param {Float32Array[][]} outputs
   * @returns {boolean}
   */
  process([ears], [out]) {
    if (!ears?.length) return true;
    const count = out[0].length;
    if (this.before.length !== count) {
      this.magnitudes = new Float64Array(count);
      this.before = new Float64Array(count);
    }
    const { magnitudes, before } = this;
    magnitudes.fill(LEAST_MAGNITUDE);
    for (const ear of ears) {
      for (let i = 0; i < count; i++) magnitudes[i] = Math.max(magnitudes[i], Math.abs(ear[i]));
    }
    before.set(magnitudes);
    const limited = this.limiter.limit(magnitudes);
    for (let side = 0; side < out.length; side++) {
      const ear = ears[Math.min(side, ears.length - 1)];
      out[side].set(ear);
      if (!limited) continue;
      for (let i = 0; i < count; i++) out[side][i] *= magnitudes[i] / before[i];
    }
    return true;
  }
}

registerProcessor("carillon-ears", EarsProcessor);
