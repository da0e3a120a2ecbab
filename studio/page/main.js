/**
 * Makes the parts of the page and hands them to each other.
 *
 * Every part is made by one function, `makeX(element, parts)` of what is seen and `makeX(parts)` of what is
 * heard. Parts ask `parts` for others when they need them, since some are made later.
 */

import { Connection } from "./connection.js";
import { makeHeader } from "./header.js";
import { Keys } from "./keys.js";
import { makeSolid } from "./solid/solid.js";
import { makeBank } from "./sound/bank.js";
import { makeNoise } from "./sound/noise.js";
import { makePlayer } from "./sound/player.js";
import { makeRecorder } from "./sound/recorder.js";
import { Selection, ServerState } from "./state.js";

/**
 * `say` tells a sentence to the person: panels/messages.js shows it.
 *
 * @typedef {object} Parts
 * @property {Connection} connection
 * @property {ServerState} state
 * @property {Selection} selection
 * @property {Keys} keys
 * @property {(text: string, kind?: "note" | "error") => void} say
 * @property {import("./sound/bank.js").Bank} bank
 * @property {import("./sound/noise.js").Noise} noise
 * @property {import("./sound/player.js").Player} player
 * @property {import("./sound/recorder.js").Recorder} recorder
 * @property {import("./solid/solid.js").Solid | null} view null until it is made
 * @property {any} tour
 * @property {any} shortcuts
 */

const PANELS = {
  messages: ["panels/messages.js", "makeMessages", "#messages"],
  targets: ["panels/targets.js", "makeTargets", "#panel-targets .panel-body"],
  clip: ["panels/clip.js", "makeClip", "#panel-clip .panel-body"],
  spectrum: ["panels/spectrum.js", "makeSpectrum", "#panel-spectrum .panel-body"],
  cost: ["panels/cost.js", "makeCost", "#panel-cost .panel-body"],
  errors: ["panels/errors.js", "makeErrors", "#panel-errors .panel-body"],
  settings: ["panels/settings.js", "makeSettings", "#panel-settings .panel-body"],
  project: ["panels/project.js", "makeProject", "#panel-project .panel-body"],
  compare: ["panels/compare.js", "makeCompare", "#panel-compare .panel-body"],
  shortcuts: ["panels/shortcuts.js", "makeShortcuts", "#shortcuts"],
  tour: ["panels/tour.js", "makeTour", "#tour"],
};

/**
 * Part of a module; null, and a line in the console, where it cannot be had.
 *
 * @param {string} path
 * @param {string} name of the function that makes it
 * @param {...any} values
 * @returns {Promise<any>}
 */
async function made(path, name, ...values) {
  try {
    return await (await import(`./${path}`))[name](...values);
  } catch (error) {
    console.error(`${path}: ${error}`);
    return null;
  }
}

/** @param {string} selector @returns {HTMLElement} */
function place(selector) {
  const element = document.querySelector(selector);
  if (!(element instanceof HTMLElement)) throw new Error(`no ${selector} in the page`);
  return element;
}

async function main() {
  const connection = new Connection();
  const state = new ServerState(connection);
  const selection = new Selection();
  selection.follow(state);
  const bank = makeBank({ connection });
  /** @type {Parts} */
  const parts = {
    connection,
    state,
    selection,
    keys: new Keys(),
    say: (text, kind = "note") => connection.listeners.tell("event said", { text, kind }),
    bank,
    player: makePlayer({ bank }),
    recorder: makeRecorder(),
    noise: makeNoise({ bank, state, connection }),
    view: null,
    tour: null,
    shortcuts: null,
  };
  Object.assign(window, { studio: parts });
  makeHeader(place(".bar"), parts);
  parts.view = makeSolid(place("#view"), parts);
  for (const [part, [path, name, selector]] of Object.entries(PANELS)) {
    const panel = await made(path, name, place(selector), parts);
    if (part === "tour" || part === "shortcuts") parts[part] = panel;
  }
  connection.open();
}

main();
