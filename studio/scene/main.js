/** A scene as a page of its own: seen and heard together, and struck. */

import { unpack } from "../page/connection.js";
import { Keys } from "../page/keys.js";
import { NO_GRAPHICS } from "../page/solid/view.js";
import { addRange } from "../standalone/controls.js";
import { begun, readScene } from "./content.js";
import { listBodies, listImpacts } from "./lists.js";
import * as shown from "./numbers.js";
import { Playback } from "./playback.js";
import { SceneSound } from "./sound.js";
import { Stage } from "./stage.js";
import { takeStrikes } from "./striking.js";
import { makeTransport } from "./transport.js";

/** @typedef {import("./content.js").Body} Body */
/** @typedef {import("./content.js").Scene} Scene */

const HELP =
  "The scene in 3D. Shift and arrow keys turn it, plus and minus zoom, 0 shows it as at first, " +
  "Enter strikes what is in the middle of the view.";
const NO_PICTURE =
  "This browser draws no 3D (WebGL 2), so the scene is heard alone: allow hardware acceleration, " +
  "or take another browser.";
const ASKED = "Browsers let pages sound only after a click";
/** Waves where the scene's own impacts are do not outshine those of strikes by hand. */
const LOUDEST_IMPACT = 0.6;

/** @param {string} id @returns {HTMLElement} */
const place = (id) => /** @type {HTMLElement} */ (document.getElementById(id));

/**
 * @param {ArrayBuffer} buffer What the page holds of the scene.
 * @param {string} processorUrl Where the processors of sound are.
 * @param {(sentence: string) => void} show Shows what went wrong.
 */
export async function start(buffer, processorUrl, show) {
  const { header, arrays } = unpack(buffer);
  const scene = readScene(header, arrays);
  const sound = new SceneSound(scene, processorUrl);
  const playback = new Playback(sound, scene.seconds);
  const keys = new Keys();
  place("name").textContent = scene.title;
  place("says").textContent = [
    shown.counted(scene.bodies.length, "object", "objects"),
    shown.counted(scene.impacts.length, "impact", "impacts"),
    `${scene.seconds.toFixed(1)} s`,
  ].join(", ");
  const transport = makeTransport(scene, playback, keys);
  const impacts = listImpacts(place("impacts"), scene);
  const stage = showStage(place("view"), scene, show);
  const strike = striker(sound, stage);
  listBodies(place("bodies"), scene.bodies, (body) => strike(body, stage?.facing(body) ?? 0));
  if (stage) takeStrikes(stage, keys, strike);
  letBegin(sound, playback);

  let before = 0;
  const frame = () => {
    const seconds = playback.frame();
    const count = begun(scene.impacts, seconds);
    // No waves of all that lies between two places of the timeline.
    if (playback.runs) markImpacts(stage, scene, before, count);
    before = count;
    impacts.show(seconds);
    transport.show();
    return { seconds, moves: playback.runs };
  };
  if (stage) stage.frame = frame;
  let waiting = 0;
  const redraw = () => {
    if (stage) stage.invalidate();
    else waiting ||= requestAnimationFrame(again);
  };
  const again = () => {
    waiting = 0;
    if (frame().moves) redraw();
  };
  playback.onChange(() => {
    before = begun(scene.impacts, playback.at);
    transport.show();
    redraw();
  });
  frame();
  sound.ready.then(() => sound.failure !== null && show(sound.failure));
  Object.assign(window, { scene: { ...scene, sound, playback, stage, strike } });
}

/**
 * @param {HTMLElement} element
 * @param {Scene} scene
 * @param {(sentence: string) => void} show
 * @returns {Stage | null} null where the browser draws no 3D
 */
function showStage(element, scene, show) {
  try {
    const stage = new Stage(element, scene);
    stage.canvas.setAttribute("role", "application");
    stage.canvas.setAttribute("aria-label", HELP);
    // What begins the scene comes before the scene.
    stage.canvas.before(place("begin"));
    if (stage.ground) place("grid").textContent = `grid ${shown.length(stage.ground.spacing)}`;
    return stage;
  } catch (error) {
    const { message } = /** @type {Error} */ (error);
    show(message === NO_GRAPHICS ? NO_PICTURE : message);
    return null;
  }
}

/**
 * @param {SceneSound} sound
 * @param {Stage | null} stage
 * @returns {(body: Body, vertex: number) => void} strikes, and tells of it
 */
function striker(sound, stage) {
  let strength = 1;
  addRange(
    place("strength"),
    { name: "Strength", low: 0.05, high: 1, step: 0.05, value: strength },
    (value) => `${Math.round(100 * value)} %`,
    (value) => {
      strength = value;
    },
  );
  const told = place("told");
  return (body, vertex) => {
    const { name, voice } = body;
    stage?.mark(body, vertex, strength);
    if (!voice) {
      told.textContent = `${name} is silent: it has no modes here.`;
      return;
    }
    const impulse = strength * voice.impulse;
    const heard = sound.strike(body, vertex, impulse);
    const { contactSeconds: contact } = voice;
    const how = shown.impulse(impulse) + (contact > 0 ? ` in ${shown.milliseconds(contact)}` : "");
    told.textContent = heard ? `${name}: struck with ${how}` : (sound.failure ?? "");
  };
}

/**
 * Covers the scene with what begins it: browsers let pages sound after a click.
 *
 * @param {SceneSound} sound
 * @param {Playback} playback
 */
function letBegin(sound, playback) {
  const cover = /** @type {HTMLButtonElement} */ (place("begin"));
  cover.hidden = false;
  const ask = () => {
    place("asked").textContent = sound.waits ? ASKED : "";
  };
  ask();
  sound.bank.onState(ask);
  cover.onclick = () => {
    playback.play();
    place("play").focus({ preventScroll: true });
  };
  playback.onChange(() => {
    if (playback.wanted) cover.hidden = true;
  });
}

/**
 * @param {Stage | null} stage
 * @param {Scene} scene
 * @param {number} first Number of the first impact to be shown.
 * @param {number} end That of the first one after them.
 */
function markImpacts(stage, { impacts }, first, end) {
  if (!stage || end <= first) return;
  const largest = Math.max(...impacts.map(({ impulse }) => impulse));
  for (const impact of impacts.slice(first, end)) {
    stage.markImpact(impact, LOUDEST_IMPACT * Math.sqrt(impact.impulse / largest));
  }
}
