// Modes that ring, in the thread of the sound card: each is a complex number that turns and decays
// with every sample, and a strike is added to it.  It stands alone, as worklets from a blob have
// nothing to import from.

/** Squared magnitude below which a mode is silent: 200 dB below full scale, where nothing is heard
 * and numbers are still far from those too small for the processor's normal format. */
const SILENT_ENERGY = 1e-20;
/** Modes of former materials that may still ring; beyond, the oldest material fades. */
const MOST_LEFT_RINGING = 4096;
const FADE_SECONDS = 0.02;
/** Time in which the limiter lets go, from silence to full scale. */
const RELEASE_SECONDS = 0.2;
const REPORTS_PER_SECOND = 30;

/**
 * A force of half a sine with unit sum; a single sample if it is too short.
 *
 * @param {number} seconds Its duration.
 * @param {number} rate Samples per second.
 * @returns {Float64Array}
 */
function halfSine(seconds, rate) {
  const count = Math.max(1, roundedToEven(seconds * rate));
  const force = new Float64Array(count);
  let sum = 0;
  for (let i = 0; i < count; i++) {
    force[i] = Math.sin((Math.PI * (i + 0.5)) / count);
    sum += force[i];
  }
  return force.map((value) => value / sum);
}

/**
 * The nearest whole number, of two the even one, as in Python: pulses are as long there.
 *
 * @param {number} value Not negative.
 * @returns {number}
 */
function roundedToEven(value) {
  const below = Math.floor(value);
  const above = value - below;
  return above > 0.5 || (above === 0.5 && below % 2 === 1) ? below + 1 : below;
}

/**
 * A strike under way.
 *
 * @typedef {object} Strike
 * @property {Float64Array} re Amplitudes of the modes, turned by the time between samples.
 * @property {Float64Array | null} im Their other parts; null if there are none.
 * @property {Float64Array} pulse Samples of the force.
 * @property {number} first Frame at which it begins.
 */

/** The modes of one material. */
class Bank {
  /**
   * @param {ArrayLike<number>} hertz (N) Frequencies; modes from half the rate on stay silent.
   * @param {ArrayLike<number>} dampings (N) [1/s]
   * @param {number} rate Samples per second.
   */
  constructor(hertz, dampings, rate) {
    const count = hertz.length;
    this.rate = rate;
    this.count = count;
    /** States. */
    this.re = new Float64Array(count);
    this.im = new Float64Array(count);
    /** What a state is multiplied by for the next sample, and its logarithm. */
    this.turnRe = new Float64Array(count);
    this.turnIm = new Float64Array(count);
    this.decay = new Float64Array(count);
    this.angle = new Float64Array(count);
    /** Modes that this rate can hold. */
    this.possible = new Uint8Array(count);
    /** How loud each is heard, and how loud it is going to be at the end of the next block. */
    this.weight = new Float64Array(count).fill(1);
    this.wantedWeight = new Float64Array(count).fill(1);
    /** Numbers of the modes that ring. */
    this.ringing = new Int32Array(count);
    this.nRinging = 0;
    this.fading = false;
    /** @type {Strike[]} */
    this.strikes = [];
    for (let k = 0; k < count; k++) {
      // What is no number, or would grow, must not spoil the others.
      if (!(hertz[k] >= 0 && hertz[k] < rate / 2 && dampings[k] >= 0)) continue;
      this.possible[k] = 1;
      this.decay[k] = -dampings[k] / rate;
      this.angle[k] = (2 * Math.PI * hertz[k]) / rate;
      const size = Math.exp(this.decay[k]);
      this.turnRe[k] = size * Math.cos(this.angle[k]);
      this.turnIm[k] = size * Math.sin(this.angle[k]);
    }
  }

  /**
   * @param {ArrayLike<number>} gains (N) What the modes sound with [full scale].
   * @param {number} contactSeconds Duration of the force; 0 is an impulse.
   * @param {number} frame When it begins; between frames, it is kept exactly.
   */
  strike(gains, contactSeconds, frame) {
    const first = Math.ceil(frame);
    const since = first - frame;
    const re = new Float64Array(this.count);
    const im = since > 0 ? new Float64Array(this.count) : null;
    for (let k = 0; k < this.count; k++) {
      const gain = this.possible[k] && Number.isFinite(gains[k]) ? gains[k] : 0;
      if (im === null) {
        re[k] = gain;
      } else {
        const size = gain * Math.exp(since * this.decay[k]);
        re[k] = size * Math.cos(since * this.angle[k]);
        im[k] = size * Math.sin(since * this.angle[k]);
      }
    }
    this.strikes.push({ re, im, pulse: halfSine(contactSeconds, this.rate), first });
  }

  /** Whether anything of it sounds or is going to. */
  get alive() {
    return this.nRinging > 0 || this.strikes.length > 0;
  }

  /** Lets it die away within some hundredths of a second. */
  fade() {
    if (this.fading) return;
    this.fading = true;
    const factor = Math.exp(-1 / (FADE_SECONDS * this.rate));
    for (let k = 0; k < this.count; k++) {
      this.turnRe[k] *= factor;
      this.turnIm[k] *= factor;
    }
  }

  /** Ends all at once. */
  silence() {
    this.re.fill(0);
    this.im.fill(0);
    this.nRinging = 0;
    this.strikes = [];
  }

  /**
   * Adds the next samples.
   *
   * @param {Float64Array} out Samples are added to it.
   * @param {number} frame Number of its first sample.
   * @param {Float64Array} force Room for as many samples, twice.
   * @param {Float64Array} otherForce
   */
  addTo(out, frame, force, otherForce) {
    const end = frame + out.length;
    const pushing = this.strikes.filter((strike) => strike.first < end);
    const alone = pushing.length === 1 ? pushing[0] : null;
    if (alone !== null && alone.im === null) {
      this._pushAll(out, frame, alone, force);
    } else if (pushing.length > 0) {
      for (let k = 0; k < this.count; k++) this._push(k, out, frame, pushing, force, otherForce);
    } else if (this.nRinging > 0) {
      this._ring(out);
    }
    if (pushing.length > 0) {
      this.strikes = this.strikes.filter((strike) => strike.first + strike.pulse.length > end);
    }
    this._findRinging(pushing.length > 0);
  }

  /**
   * One mode under one force or several.
   *
   * @param {number} k Number of the mode.
   * @param {Float64Array} out
   * @param {number} frame
   * @param {Strike[]} strikes
   * @param {Float64Array} force
   * @param {Float64Array} otherForce
   */
  _push(k, out, frame, strikes, force, otherForce) {
    let pushed = false;
    for (const { re, im, pulse, first } of strikes) {
      if (re[k] === 0 && (im === null || im[k] === 0)) continue;
      if (!pushed) {
        force.fill(0);
        otherForce.fill(0);
        pushed = true;
      }
      const begin = Math.max(0, first - frame);
      const end = Math.min(out.length, first + pulse.length - frame);
      for (let i = begin; i < end; i++) force[i] += re[k] * pulse[frame + i - first];
      if (im === null) continue;
      for (let i = begin; i < end; i++) otherForce[i] += im[k] * pulse[frame + i - first];
    }
    if (!pushed) {
      if (this.re[k] !== 0 || this.im[k] !== 0) this._ringOne(k, out);
      return;
    }
    const c = this.turnRe[k];
    const s = this.turnIm[k];
    const step = (this.wantedWeight[k] - this.weight[k]) / out.length;
    let weight = this.weight[k];
    let x = this.re[k];
    let y = this.im[k];
    for (let i = 0; i < out.length; i++) {
      x += force[i];
      y += otherForce[i];
      weight += step;
      out[i] += weight * y;
      const turned = x * c - y * s;
      y = x * s + y * c;
      x = turned;
    }
    this.re[k] = x;
    this.im[k] = y;
    this.weight[k] = this.wantedWeight[k];
  }

  /**
   * All under the one force that there mostly is.
   *
   * @param {Float64Array} out
   * @param {number} frame
   * @param {Strike} strike
   * @param {Float64Array} force
   */
  _pushAll(out, frame, strike, force) {
    const { first, pulse, re } = strike;
    force.fill(0);
    const end = Math.min(out.length, first + pulse.length - frame);
    for (let i = Math.max(0, first - frame); i < end; i++) force[i] = pulse[frame + i - first];
    const whole = this.count - (this.count % 4);
    for (let k = 0; k < whole; k += 4) {
      if (this._inFull(k) && this._inFull(k + 1) && this._inFull(k + 2) && this._inFull(k + 3)) {
        this._pushFour(out, force, re, k);
      } else {
        for (let l = k; l < k + 4; l++) this._pushOne(l, out, force, re[l]);
      }
    }
    for (let k = whole; k < this.count; k++) this._pushOne(k, out, force, re[k]);
  }

  /**
   * All that ring, four side by side where they are heard in full: the processor then need not wait
   * for one sample of a mode before it begins the next.
   *
   * @param {Float64Array} out
   */
  _ring(out) {
    const { ringing } = this;
    let waiting = 0;
    let k = 0, l = 0, m = 0;
    for (let j = 0; j < this.nRinging; j++) {
      const n = ringing[j];
      if (!this._inFull(n)) {
        this._ringOne(n, out);
        continue;
      }
      waiting++;
      if (waiting === 1) k = n;
      else if (waiting === 2) l = n;
      else if (waiting === 3) m = n;
      else {
        this._ringFour(out, k, l, m, n);
        waiting = 0;
      }
    }
    if (waiting > 0) this._ringOne(k, out);
    if (waiting > 1) this._ringOne(l, out);
    if (waiting > 2) this._ringOne(m, out);
  }

  /**
   * Whether a mode is heard in full, and goes on to be.
   *
   * @param {number} k
   * @returns {boolean}
   */
  _inFull(k) {
    return this.weight[k] === 1 && this.wantedWeight[k] === 1;
  }

  /**
   * @param {number} k Number of the mode.
   * @param {Float64Array} out
   * @param {Float64Array} force For every sample.
   * @param {number} gain
   */
  _pushOne(k, out, force, gain) {
    const count = out.length;
    const c = this.turnRe[k];
    const s = this.turnIm[k];
    const step = (this.wantedWeight[k] - this.weight[k]) / count;
    let weight = this.weight[k];
    let x = this.re[k];
    let y = this.im[k];
    for (let i = 0; i < count; i++) {
      x += gain * force[i];
      weight += step;
      out[i] += weight * y;
      const turned = x * c - y * s;
      y = x * s + y * c;
      x = turned;
    }
    this.re[k] = x;
    this.im[k] = y;
    this.weight[k] = this.wantedWeight[k];
  }

  /**
   * @param {Float64Array} out
   * @param {Float64Array} force For every sample.
   * @param {Float64Array} gains (N)
   * @param {number} k The first of four modes.
   */
  _pushFour(out, force, gains, k) {
    const { re, im, turnRe, turnIm } = this;
    const count = out.length;
    const l = k + 1, m = k + 2, n = k + 3;
    const ck = turnRe[k], cl = turnRe[l], cm = turnRe[m], cn = turnRe[n];
    const sk = turnIm[k], sl = turnIm[l], sm = turnIm[m], sn = turnIm[n];
    const gk = gains[k], gl = gains[l], gm = gains[m], gn = gains[n];
    let xk = re[k], xl = re[l], xm = re[m], xn = re[n];
    let yk = im[k], yl = im[l], ym = im[m], yn = im[n];
    for (let i = 0; i < count; i++) {
      const f = force[i];
      xk += gk * f;
      xl += gl * f;
      xm += gm * f;
      xn += gn * f;
      out[i] += yk + yl + (ym + yn);
      const tk = xk * ck - yk * sk;
      const tl = xl * cl - yl * sl;
      const tm = xm * cm - ym * sm;
      const tn = xn * cn - yn * sn;
      yk = xk * sk + yk * ck;
      yl = xl * sl + yl * cl;
      ym = xm * sm + ym * cm;
      yn = xn * sn + yn * cn;
      xk = tk;
      xl = tl;
      xm = tm;
      xn = tn;
    }
    re[k] = xk;
    re[l] = xl;
    re[m] = xm;
    re[n] = xn;
    im[k] = yk;
    im[l] = yl;
    im[m] = ym;
    im[n] = yn;
  }

  /**
   * @param {number} k Number of the mode.
   * @param {Float64Array} out
   */
  _ringOne(k, out) {
    const c = this.turnRe[k];
    const s = this.turnIm[k];
    const step = (this.wantedWeight[k] - this.weight[k]) / out.length;
    let weight = this.weight[k];
    let x = this.re[k];
    let y = this.im[k];
    for (let i = 0; i < out.length; i++) {
      weight += step;
      out[i] += weight * y;
      const turned = x * c - y * s;
      y = x * s + y * c;
      x = turned;
    }
    this.re[k] = x;
    this.im[k] = y;
    this.weight[k] = this.wantedWeight[k];
  }

  /**
   * @param {Float64Array} out
   * @param {number} k Numbers of four modes.
   * @param {number} l
   * @param {number} m
   * @param {number} n
   */
  _ringFour(out, k, l, m, n) {
    const { re, im, turnRe, turnIm } = this;
    const ck = turnRe[k], cl = turnRe[l], cm = turnRe[m], cn = turnRe[n];
    const sk = turnIm[k], sl = turnIm[l], sm = turnIm[m], sn = turnIm[n];
    let xk = re[k], xl = re[l], xm = re[m], xn = re[n];
    let yk = im[k], yl = im[l], ym = im[m], yn = im[n];
    const count = out.length;
    for (let i = 0; i < count; i++) {
      out[i] += yk + yl + (ym + yn);
      const tk = xk * ck - yk * sk;
      const tl = xl * cl - yl * sl;
      const tm = xm * cm - ym * sm;
      const tn = xn * cn - yn * sn;
      yk = xk * sk + yk * ck;
      yl = xl * sl + yl * cl;
      ym = xm * sm + ym * cm;
      yn = xn * sn + yn * cn;
      xk = tk;
      xl = tl;
      xm = tm;
      xn = tn;
    }
    re[k] = xk;
    re[l] = xl;
    re[m] = xm;
    re[n] = xn;
    im[k] = yk;
    im[l] = yl;
    im[m] = ym;
    im[n] = yn;
  }

  /**
   * Lists the modes that ring, and ends those that nobody hears.
   *
   * @param {boolean} all Whether others than those of the list may have been struck.
   */
  _findRinging(all) {
    const { re, im, ringing } = this;
    const before = all ? this.count : this.nRinging;
    let found = 0;
    for (let j = 0; j < before; j++) {
      const k = all ? j : ringing[j];
      if (re[k] * re[k] + im[k] * im[k] > SILENT_ENERGY) {
        ringing[found++] = k;
      } else {
        re[k] = 0;
        im[k] = 0;
      }
    }
    this.nRinging = found;
  }
}

/**
 * Keeps samples within full scale.  As long as none is beyond, it changes nothing.  Before one that
 * is, and within its block, loudness falls to what lets it just reach full scale; then it rises again.
 */
class Limiter {
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
