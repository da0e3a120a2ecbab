/** A design as a page of its own: what it holds is read, shown, and struck. */

import { unpack } from "../page/connection.js";
import { Keys } from "../page/keys.js";
import { makeBank } from "../page/sound/bank.js";
import { renderOffline } from "../page/sound/offline.js";
import { makePlayer } from "../page/sound/player.js";
import { Selection } from "../page/state.js";
import { makeControls } from "./controls.js";
import { readDesign } from "./design.js";
import { showSolid } from "./solid.js";
import { makeSpectrum } from "./spectrum.js";
import { makeTargets } from "./targets.js";

const LONGEST_SECONDS = 6;
/** A decay by 60 dB, in nepers. */
const DECAY = Math.log(1000);

/**
 * @typedef {object} Page What parts of the page share.
 * @property {import("./design.js").Design} design
 * @property {import("../page/sound/bank.js").Bank} bank
 * @property {import("../page/sound/player.js").Player} player
 * @property {Selection} selection
 * @property {Keys} keys
 * @property {(vertex: number, strength?: number) => void} strike
 * @property {(number: number) => Promise<AudioBuffer>} clip Modes of a target's clip.
 * @property {number} seconds How long the design rings.
 * @property {(sentence: string | null) => void} tell
 */

/** @param {string} id @returns {HTMLElement} */
const place = (id) => /** @type {HTMLElement} */ (document.getElementById(id));

/** @param {Float64Array} dampings [1/s] @returns {number} until all is 60 dB lower [s] */
function ringingSeconds(dampings) {
  const slowest = Math.min(...dampings);
  return slowest > 0 ? Math.min(LONGEST_SECONDS, DECAY / slowest) : LONGEST_SECONDS;
}

/**
 * @param {ArrayBuffer} buffer What the page holds of the design.
 * @param {string} processorUrl Where the processor of the bank is.
 * @param {(sentence: string) => void} show Shows what went wrong.
 */
export async function start(buffer, processorUrl, show) {
  const { header, arrays } = unpack(buffer);
  const design = readDesign(header, arrays);
  const bank = makeBank({}, { processorUrl });
  bank.take(design.header, design.bank);
  const selection = new Selection();
  selection.set({ target: design.targets[0]?.name ?? null });
  /** @type {Map<number, Promise<AudioBuffer>>} */
  const clips = new Map();

  /** @param {number} number @returns {Promise<AudioBuffer>} */
  async function sounded(number) {
    const { hertz, dampings, amplitudes } = design.wanted;
    if (!bank.context) throw new Error(bank.failure ?? "");
    const rate = bank.context.sampleRate;
    const samples = await renderOffline({
      hertz,
      dampings,
      messages: [{ do: "strike", gains: amplitudes[number], at_seconds: 0 }],
      seconds: ringingSeconds(dampings),
      rate,
      processorUrl,
    });
    const sound = new AudioBuffer({ length: samples.length, sampleRate: rate });
    sound.copyToChannel(samples, 0);
    return sound;
  }

  /** @type {Page} */
  const page = {
    design,
    bank,
    player: makePlayer({ bank }),
    selection,
    keys: new Keys(),
    strike(vertex, strength = selection.current.strength) {
      bank.strike(vertex, strength);
      selection.set({ vertex });
      view?.wave(vertex, strength);
    },
    clip(number) {
      const made = clips.get(number) ?? sounded(number);
      clips.set(number, made);
      return made;
    },
    seconds: ringingSeconds(design.bank.dampings),
    tell: (sentence) => (sentence === null ? place("message").replaceChildren() : show(sentence)),
  };
  place("name").textContent = design.name;
  place("says").textContent =
    `${design.bank.hertz.length} modes, ` +
    `${design.rmsCents.toFixed(1)} cents (rms) from those of the clips`;
  const view = showSolid(place("view"), page);
  makeControls(place("controls"), page, view !== null);
  makeTargets(place("targets"), page);
  makeSpectrum(place("spectrum"), page);
  bank.ready.then(() => page.tell(bank.failure));

  /**
   * A strike as samples.
   *
   * @param {number} vertex
   * @param {number} seconds
   * @param {number} rate
   */
  const render = (vertex, seconds, rate) => {
    const count = design.bank.hertz.length;
    const gains = design.bank.gains.slice(vertex * count, (vertex + 1) * count);
    const { hertz, dampings } = design.bank;
    const messages = [/** @type {const} */ ({ do: "strike", gains, at_seconds: 0 })];
    return renderOffline({ hertz, dampings, messages, seconds, rate, processorUrl });
  };
  Object.assign(window, { standalone: { ...page, view, render } });
}
