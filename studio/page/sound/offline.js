// Strikes as samples, made as fast as the machine can, by the processor that also sounds live.

import { makeNode } from "./bank.js";

/**
 * @param {object} sound
 * @param {ArrayLike<number>} sound.hertz (N)
 * @param {ArrayLike<number>} sound.dampings (N) [1/s]
 * @param {import("../types.js").BankMessage[]} sound.messages Strikes and whatever else it is told.
 * @param {number} sound.seconds Length.
 * @param {number} [sound.rate] Samples per second.
 * @param {string} [sound.processorUrl] Where `bank-processor.js` is.
 * @returns {Promise<Float32Array<ArrayBuffer>>}
 */
export async function renderOffline(sound) {
  const { hertz, dampings, messages, seconds, rate = 44100 } = sound;
  const url = sound.processorUrl ?? new URL("bank-processor.js", import.meta.url).href;
  const context = new OfflineAudioContext(1, Math.max(1, Math.round(seconds * rate)), rate);
  await context.audioWorklet.addModule(url);
  const node = makeNode(context, [{ do: "bank", hertz, dampings }, ...messages]);
  node.connect(context.destination);
  const buffer = await context.startRendering();
  return buffer.getChannelData(0);
}
