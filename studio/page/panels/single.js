/** The sound of one mode of a clip. */

import { decaySeconds } from "./numbers.js";

const RATE_HZ = 44100;
const LOUDNESS = 0.5;
const LONGEST_SECONDS = 4;
const LEAST_SECONDS = 0.05;

/**
 * A mode that rings until it has fallen by 60 dB.
 *
 * @param {{ hertz: number, damping_per_second: number }} mode
 * @returns {AudioBuffer}
 */
export function soundOfMode(mode) {
  const decay = decaySeconds(mode.damping_per_second);
  const seconds = Math.min(LONGEST_SECONDS, Math.max(LEAST_SECONDS, decay));
  const rate = Math.max(RATE_HZ, 2 * Math.ceil(mode.hertz));
  const buffer = new AudioBuffer({ length: Math.ceil(seconds * rate), sampleRate: rate, numberOfChannels: 1 });
  const samples = buffer.getChannelData(0);
  for (let k = 0; k < samples.length; k += 1) {
    const time = k / rate;
    // What is cut off at the end falls linearly, so that nothing clicks.
    const end = Math.min(1, (samples.length - 1 - k) / (0.01 * rate));
    const swing = Math.sin(2 * Math.PI * mode.hertz * time);
    samples[k] = LOUDNESS * end * Math.exp(-mode.damping_per_second * time) * swing;
  }
  return buffer;
}
