// A solid that is struck: its modes, as a module for browsers that needs nothing else.
//
//   import { createSolid } from "./pan.js";
//   const context = new AudioContext();
//   const solid = await createSolid(context); // an AudioNode
//   solid.connect(context.destination);
//   solid.strike(0); // the first point, with 1 N s
//   solid.strike("rim", { strength: 0.5, contactSeconds: 0.001, at: context.currentTime + 0.1 });
//
// All samples are multiplied by a gain, by default `model.gain`: it keeps a strike of 1 N s at the loudest point
// within full scale. Harder strikes, and strikes while others ring, may go beyond, and browsers clip that: give a
// smaller gain, `createSolid(context, { gain: 0.3 })`. With a gain of 1, 1 N s sounds as loud as the clip of a target.
//
// The file is its own AudioWorklet module, so that it has to have an address (http:, https: or blob:). `render`
// needs no browser.  Made by Carillon $version.

/** Gain, frequencies [Hz], dampings [1/s], and amplitudes of the points [full scale per N s], without the gain. */
export const model = $model;

const PROCESSOR = "$processor";
/** Squared magnitude below which a mode is silent. */
const SILENT = 1e-20;

/** Number of a point, by its number or its name. */
function pointNumber(point) {
  const number = typeof point === "number" ? point : model.points.findIndex((each) => each.name === point);
  if (!model.points[number]) {
    const names = model.points.map((each) => each.name).join(", ");
    throw new RangeError(`there is no point ${point}, expected a number below ${model.points.length} or one of ${names}`);
  }
  return number;
}

/** A force of half a sine with unit sum; one sample if it is short. */
function halfSine(seconds, rate) {
  const exact = seconds * rate;
  const below = Math.floor(exact);
  const up = exact - below > 0.5 || (exact - below === 0.5 && below % 2 === 1);
  const count = Math.max(1, up ? below + 1 : below);
  const force = Float64Array.from({ length: count }, (_, i) => Math.sin((Math.PI * (i + 0.5)) / count));
  const sum = force.reduce((total, value) => total + value, 0);
  return force.map((value) => value / sum);
}

/** The modes: each is a complex number that turns and decays with every sample, and a force is added to it. */
class Modes {
  constructor(rate, gain) {
    this.rate = rate;
    this.gain = gain;
    this.strikes = [];
    this.modes = model.frequencies.map((hertz, k) => {
      const size = Math.exp(-model.dampings[k] / rate);
      const angle = (2 * Math.PI * hertz) / rate;
      const turn = [size * Math.cos(angle), size * Math.sin(angle)];
      return { k, x: 0, y: 0, turn, audible: hertz < rate / 2 };
    });
  }

  /** A strike from a frame on; frames may be fractions, and are rounded up. */
  strike({ point, strength = 1, contactSeconds = 0 }, frame) {
    const gains = model.points[point].amplitudes.map((amplitude) => this.gain * strength * amplitude);
    this.strikes.push({ gains, force: halfSine(contactSeconds, this.rate), first: Math.ceil(frame) });
  }

  /** Adds the samples from a frame on. */
  addTo(out, frame) {
    const end = frame + out.length;
    const under = this.strikes.filter((strike) => strike.first < end);
    for (const mode of this.modes) {
      if (!mode.audible) continue;
      let { x, y } = mode;
      if (under.length === 0 && x * x + y * y < SILENT) {
        mode.x = mode.y = 0;
        continue;
      }
      const [c, s] = mode.turn;
      for (let i = 0; i < out.length; i++) {
        for (const { gains, force, first } of under) x += gains[mode.k] * (force[frame + i - first] ?? 0);
        out[i] += y;
        const turned = x * c - y * s;
        y = x * s + y * c;
        x = turned;
      }
      mode.x = x;
      mode.y = y;
    }
    this.strikes = this.strikes.filter((strike) => strike.first + strike.force.length > end);
  }
}

/**
 * Samples of one strike, without Web Audio.
 *
 * @param {number | string} point Number or name.
 * @param {number} seconds Length of the sound.
 * @param {number} rate Samples per second.
 * @param {{strength?: number, contactSeconds?: number, gain?: number}} [how] Impulse [N s], duration of the force
 *   [s], and factor on the samples.
 * @returns {Float64Array}
 */
export function render(point, seconds, rate, { gain = model.gain, ...how } = {}) {
  const modes = new Modes(rate, gain);
  modes.strike({ ...how, point: pointNumber(point) }, 0);
  const out = new Float64Array(Math.round(seconds * rate));
  modes.addTo(out, 0);
  return out;
}

/**
 * The solid as a node of an audio graph, with a method `strike(point, {strength, contactSeconds, at})`; `at` is a
 * time of the context [s].
 *
 * @param {BaseAudioContext} context
 * @param {object} [settings]
 * @param {{point: number | string, strength?: number, contactSeconds?: number, at?: number}[]} [settings.strikes] Those
 *   that are known from the beginning; a context that renders offline takes no others in time.
 * @param {number} [settings.gain] Factor on the samples.
 * @returns {Promise<AudioWorkletNode & {strike: (point: number | string, how?: object) => void}>}
 */
export async function createSolid(context, settings = {}) {
  if (Array.isArray(settings)) throw new TypeError("expected { strikes, gain }, found a list; give { strikes: list }");
  const { strikes = [], gain = model.gain } = settings;
  await context.audioWorklet.addModule(import.meta.url);
  const known = strikes.map((each) => ({ ...each, point: pointNumber(each.point) }));
  const processorOptions = { strikes: known, gain };
  const options = { numberOfInputs: 0, outputChannelCount: [1], processorOptions };
  const node = new AudioWorkletNode(context, PROCESSOR, options);
  node.strike = (point, how = {}) => node.port.postMessage({ ...how, point: pointNumber(point) });
  return node;
}

if (typeof registerProcessor === "function") {
  registerProcessor(
    PROCESSOR,
    class extends AudioWorkletProcessor {
      constructor({ processorOptions }) {
        super();
        this.modes = new Modes(sampleRate, processorOptions.gain);
        this.samples = new Float64Array(128);
        processorOptions.strikes.forEach((strike) => this.take(strike));
        this.port.onmessage = ({ data }) => this.take(data);
      }

      take(strike) {
        const frame = strike.at === undefined ? currentFrame : strike.at * sampleRate;
        this.modes.strike(strike, Math.max(currentFrame, frame));
      }

      process(_, [[out]]) {
        if (this.samples.length !== out.length) this.samples = new Float64Array(out.length);
        this.samples.fill(0);
        this.modes.addTo(this.samples, currentFrame);
        out.set(this.samples);
        return true;
      }
    },
  );
}
