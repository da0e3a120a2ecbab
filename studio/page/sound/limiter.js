/** Time in which the limiter lets go, from silence to full scale. */
const RELEASE_SECONDS = 0.2;

/**
 * Keeps samples within full scale.  As long as none is beyond, it changes nothing.  Before one that
 * is, and within its block, loudness falls to what lets it just reach full scale; then it rises again.
 */
export class Limiter {
  /** @param {number} rate Samples per second. */
  constructor(rate) {
    this.gain = 1;
    this.rise = 1 / (RELEASE_SECONDS * rate);
    this.gains = new Float64Array(128);
  }

  /**
   * @param {Float64Array} samples Changed in place.
   * @returns {boolean} Whether it held anything back.
   */
  limit(samples) {
    const count = samples.length;
    let peak = 0;
    for (let i = 0; i < count; i++) {
      // What is no number would never leave the sums again, and is no sound.
      if (!Number.isFinite(samples[i])) samples[i] = 0;
      peak = Math.max(peak, Math.abs(samples[i]));
    }
    if (peak <= 1 && this.gain === 1) return false;
    if (this.gains.length !== count) this.gains = new Float64Array(count);
    const { gains } = this;
    // It falls as steadily as the block before the peak allows.
    const fall = 2 / count;
    let allowed = Infinity;
    for (let i = count - 1; i >= 0; i--) {
      allowed = Math.min(allowed + fall, 1 / Math.max(1, Math.abs(samples[i])));
      gains[i] = allowed;
    }
    for (let i = 0; i < count; i++) {
      this.gain = Math.min(1, this.gain + this.rise, gains[i]);
      samples[i] *= this.gain;
    }
    return true;
  }
}
