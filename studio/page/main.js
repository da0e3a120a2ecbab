/**
 * Makes the parts of the page and hands them to each other.
 *
 * Every part is made by one function, `makeX(element, parts)` of what is seen and `makeX(parts)` of what is
 * heard. Parts ask `parts` for others when they need them, since some are made later.
 */

import { Connection } from "./connection.js";
import { makeHeader } from "./header.js";
import { Keys } from "./keys.js";
import { makeClip } from "./panels/clip.js";
import { makeCompare } from "./panels/compare.js";
import { makeCost } from "./panels/cost.js";
import { makeErrors } from "./panels/errors.js";
import { makeHeads } from "./panels/heads.js";
import { makeMessages } from "./panels/messages.js";
import { makeMaterials } from "./panels/materials.js";
import { makeProject } from "./panels/project.js";
import { makeRegions } from "./panels/regions.js";
import { makeSettings } from "./panels/settings.js";
import { makeSize } from "./panels/size.js";
import { makeShortcuts } from "./panels/shortcuts.js";
import { makeSpectrum } from "./panels/spectrum.js";
import { makeSupports } from "./panels/supports.js";
import { makeTargets } from "./panels/targets.js";
import { makeTour } from "./panels/tour.js";
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
 * @property {import("./panels/materials.js").Materials} materials
 * @property {(text: string, kind?: "note" | "error") => void} say
 * @property {import("./sound/bank.js").Bank} bank
 * @property {import("./sound/noise.js").Noise} noise
 * @property {import("./sound/player.js").Player} player
 * @property {import("./sound/recorder.js").Recorder} recorder
 * @property {import("./solid/solid.js").Solid | null} view null until it is made
 * @property {ReturnType<typeof makeTour> | null} tour
 * @property {ReturnType<typeof makeShortcuts> | null} shortcuts
 */

/** What is made in the body of `#panel-NAME`. */
const PANELS = {
  size: makeSize,
  regions: makeRegions,
  supports: makeSupports,
  targets: makeTargets,
  clip: makeClip,
  spectrum: makeSpectrum,
  cost: makeCost,
  errors: makeErrors,
  settings: makeSettings,
  project: makeProject,
  compare: makeCompare,
  heads: makeHeads,
};

/** @param {string} selector @returns {HTMLElement} */
function place(selector) {
  const element = document.querySelector(selector);
  if (!(element instanceof HTMLElement)) throw new Error(`no ${selector} in the page`);
  return element;
}

function main() {
  const connection = new Connection();
  const state = new ServerState(connection);
  const selection = new Selection();
  selection.follow(state);
  selection.followRows(state);
  const bank = makeBank({ connection });
  /** @type {Parts} */
  const parts = {
    connection,
    state,
    selection,
    keys: new Keys(),
    materials: makeMaterials({ connection }),
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
  makeMessages(place("#messages"), parts);
  makeHeader(place(".bar"), parts);
  parts.view = makeSolid(place("#view"), parts);
  for (const [name, make] of Object.entries(PANELS)) make(place(`#panel-${name} .panel-body`), parts);
  parts.shortcuts = makeShortcuts(place("#shortcuts"), parts);
  parts.tour = makeTour(place("#tour"), parts);
  connection.open();
}

main();
