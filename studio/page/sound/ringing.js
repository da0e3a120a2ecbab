// The modes of a material that ring: each is a complex number that turns and decays with every sample, and a
// strike is added to it.

/** Squared magnitude below which a mode is silent: 200 dB below full scale, where nothing is heard
 * and numbers are still far from those too small for the processor's normal format. */
const SILENT_ENERGY = 1e-20;
const FADE_SECONDS = 0.02;

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
export class Bank {
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
      this._pushAlone(out, frame, alone, force);
    } else if (pushing.length > 0) {
      for (let k = 0; k < this.count; k++) this._pushSeveral(k, out, frame, pushing, force, otherForce);
    } else if (this.nRinging > 0) {
      this._ring(out, force);
    }
    if (pushing.length > 0) {
      this.strikes = this.strikes.filter((strike) => strike.first + strike.pulse.length > end);
    }
    this._findRinging(pushing.length > 0);
  }

  /**
   * One mode under several forces, or under one that begins between samples.
   *
   * @param {number} k Number of the mode.
   * @param {Float64Array} out
   * @param {number} frame
   * @param {Strike[]} strikes
   * @param {Float64Array} force
   * @param {Float64Array} otherForce
   */
  _pushSeveral(k, out, frame, strikes, force, otherForce) {
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
    if (pushed) this._one(k, out, force, 1, otherForce, 1);
    else if (this.re[k] !== 0 || this.im[k] !== 0) this._one(k, out, force, 0, force, 0);
  }

  /**
   * All under the one force that there mostly is.
   *
   * @param {Float64Array} out
   * @param {number} frame
   * @param {Strike} strike
   * @param {Float64Array} force
   */
  _pushAlone(out, frame, strike, force) {
    const { first, pulse, re } = strike;
    force.fill(0);
    const end = Math.min(out.length, first + pulse.length - frame);
    for (let i = Math.max(0, first - frame); i < end; i++) force[i] = pulse[frame + i - first];
    const whole = this.count - (this.count % 4);
    for (let k = 0; k < whole; k += 4) {
      if (this._inFull(k) && this._inFull(k + 1) && this._inFull(k + 2) && this._inFull(k + 3)) {
        this._pushFour(out, force, re, k);
      } else {
        for (let l = k; l < k + 4; l++) this._one(l, out, force, re[l], force, 0);
      }
    }
    for (let k = whole; k < this.count; k++) this._one(k, out, force, re[k], force, 0);
  }

  /**
   * All that ring, four side by side where they are heard in full: the processor then need not wait
   * for one sample of a mode before it begins the next.
   *
   * @param {Float64Array} out
   * @param {Float64Array} force Room for as many samples: that nothing pushes.
   */
  _ring(out, force) {
    force.fill(0);
    const { ringing } = this;
    let waiting = 0;
    let k = 0, l = 0, m = 0;
    for (let j = 0; j < this.nRinging; j++) {
      const n = ringing[j];
      if (!this._inFull(n)) {
        this._one(n, out, force, 0, force, 0);
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
    if (waiting > 0) this._one(k, out, force, 0, force, 0);
    if (waiting > 1) this._one(l, out, force, 0, force, 0);
    if (waiting > 2) this._one(m, out, force, 0, force, 0);
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
   * One mode, as loud as it is to be heard.
   *
   * @param {number} k Number of the mode.
   * @param {Float64Array} out
   * @param {Float64Array} force For every sample, on the state's real part.
   * @param {number} gain What it is multiplied by; 0 if the mode only rings.
   * @param {Float64Array} otherForce The same of its imaginary part.
   * @param {number} otherGain
   */
  _one(k, out, force, gain, otherForce, otherGain) {
    const count = out.length;
    const c = this.turnRe[k];
    const s = this.turnIm[k];
    const step = (this.wantedWeight[k] - this.weight[k]) / count;
    let weight = this.weight[k];
    let x = this.re[k];
    let y = this.im[k];
    for (let i = 0; i < count; i++) {
      x += gain * force[i];
      y += otherGain * otherForce[i];
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
