/** Play and pause, the timeline, loop, volume, and their keys. */

import { addRange } from "../standalone/controls.js";
import * as shown from "./numbers.js";
import { makeTimeline } from "./timeline.js";

/** @typedef {import("./playback.js").Playback} Playback */

const SKIP_SECONDS = 0.5;
const FRAME_SECONDS = 1 / 60;

/** @param {string} id @returns {HTMLElement} */
const place = (id) => /** @type {HTMLElement} */ (document.getElementById(id));

/**
 * @param {import("./content.js").Scene} scene
 * @param {Playback} playback
 * @param {import("../page/keys.js").Keys} keys
 * @returns {{show: () => void}}
 */
export function makeTransport(scene, playback, keys) {
  const [play, loop, clock] = ["play", "loop", "clock"].map(place);
  const timeline = makeTimeline(place("timeline"), scene, playback);
  addVolume(place("volume"), playback);
  play.onclick = () => playback.toggle();
  loop.onclick = () => {
    playback.loop = !playback.loop;
    loop.setAttribute("aria-pressed", String(playback.loop));
  };

  /** @type {[string, string, () => void][]} */
  const deeds = [
    [" ", "Play or pause", () => playback.toggle()],
    ["ArrowLeft", "Back", () => playback.seek(playback.at - SKIP_SECONDS)],
    ["ArrowRight", "On", () => playback.seek(playback.at + SKIP_SECONDS)],
    [",", "A picture back", () => playback.seek(playback.at - FRAME_SECONDS)],
    [".", "A picture on", () => playback.seek(playback.at + FRAME_SECONDS)],
    ["Home", "To the beginning", () => playback.seek(0)],
    ["l", "Play over and over, or once", () => loop.click()],
  ];
  for (const [key, says, run] of deeds) keys.add(key, says, run);
  // The timeline takes keys itself, and those of the page mean the same on it.
  timeline.input.addEventListener("keydown", (event) => {
    const deed = deeds.find(([key]) => key === event.key);
    if (!deed || event.ctrlKey || event.metaKey || event.altKey || event.shiftKey) return;
    deed[2]();
    event.preventDefault();
  });

  return {
    show() {
      const says = playback.wanted ? "Pause" : "Play";
      if (play.ariaLabel !== says) {
        play.ariaLabel = says;
        play.title = `${says} (space)`;
        play.dataset.does = says;
      }
      clock.textContent = `${shown.time(playback.at)} / ${shown.time(scene.seconds)} s`;
      timeline.show(playback.at);
    },
  };
}

/** @param {HTMLElement} element @param {Playback} playback */
function addVolume(element, { sound }) {
  addRange(
    element,
    { name: "Volume", low: 0, high: 1, step: 0.05, value: 1 },
    (value) => `${Math.round(100 * value)} %`,
    // As loudness is felt: half way it is a quarter.
    (value) => {
      sound.volume = value ** 2;
    },
  );
}
