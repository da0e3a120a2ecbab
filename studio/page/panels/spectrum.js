/** The spectrum at the selected target: what is wanted against what the solid has now. */

import { chosenPoint } from "./chosen.js";
import { make, setAttribute, setText } from "./dom.js";
import { makeLegend } from "./legend.js";
import { fixed, withHertz } from "./numbers.js";
import { levelDifference, pairsOf } from "./pairs.js";
import {
  axis,
  colour,
  drawRing,
  drawStems,
  hertzAxis,
  hertzRange,
  joinPairs,
  makePlot,
  nearestMark,
} from "./plots.js";
import { makeZoom } from "./zoom.js";

/** @typedef {import("./pairs.js").Pair} Pair */
/** @typedef {import("./plots.js").Mark} Mark */

const HEIGHT = 240;
const LOWEST_DECIBELS = -80;

/**
 * Makes the plot of both spectra.
 *
 * @param {HTMLElement} element
 * @param {import("../main.js").Parts} parts
 */
export function makeSpectrum(element, parts) {
  const { connection, state, selection } = parts;
  /** @type {[any, any] | null} */
  let bank = null;
  /** @type {Pair[]} */
  let pairs = [];
  /** @type {import("uplot") | null} */
  let plot = null;

  const zoom = makeZoom(() => plot, () => chosenPair()?.hertz ?? null);
  const none = make("p", { class: "hint" }, "Open a solid to see its spectrum.");
  const caption = make("p", { class: "hint" });
  const picture = make("div", { class: "plot", role: "img" });
  const readout = make("p", { class: "readout" });
  const body = make(
    "div",
    { hidden: true },
    caption,
    makeLegend([
      { sign: "disc", text: "wanted", kind: "wanted" },
      { sign: "diamond", text: "now", kind: "now" },
    ]),
    picture,
    zoom.buttons,
    readout,
  );
  element.append(none, body);

  function show() {
    const point = chosenPoint(parts);
    const name = point.name ?? (selection.current.vertex === null ? "the first point" : "the point struck last");
    pairs = bank ? pairsOf(bank[0], bank[1], state.current, point) : [];
    none.hidden = pairs.length > 0;
    body.hidden = pairs.length === 0;
    if (pairs.length === 0) return;
    setText(caption, `At ${name}; levels below the loudest mode there. ${freedomOf(bank?.[0].rigid_motions)}`);
    const hertz = [...new Set([...pairs.map((pair) => pair.hertz), ...pairs.flatMap(wantedHertz)])];
    hertz.sort((one, other) => one - other);
    plot ??= create();
    // Marks are drawn by hand: what uPlot gets only says how wide its axis is.
    plot.setData([hertz, hertz.map(() => null)], true);
    setAttribute(picture, "aria-label", summary(name));
    showMode();
  }

  function create() {
    return makePlot(
      picture,
      HEIGHT,
      {
        scales: {
          x: { time: false, distr: 3, range: (one) => zoom.range(hertzRange(Array.from(one.data[0]))) },
          y: { range: () => [floorOf(pairs), 4] },
        },
        axes: [hertzAxis(), axis("Level [dB]", { size: 42 })],
        series: [{}, { show: true }],
        cursor: zoom.cursor,
        hooks: {
          draw: [draw],
          setSelect: [zoom.select],
          setCursor: [
            (one) => {
              const near = nearestMark(one, pairs.flatMap((pair) => [markOf(pair), wantedMark(pair) ?? undefined]));
              selection.set({ mode: near === null ? null : (pairs[near >> 1]?.mode ?? null) });
            },
          ],
        },
      },
      [[100, 1000], [null, null]],
    );
  }

  /** @param {import("uplot")} one */
  function draw(one) {
    const wanted = pairs.filter((pair) => wantedMark(pair) !== null);
    const wantedMarks = wanted.map((pair) => /** @type {Mark} */ (wantedMark(pair)));
    joinPairs(one, wantedMarks, wanted.map(markOf), colour("--plot-pair"));
    drawStems(one, wantedMarks, "disc", colour("--wanted"));
    drawStems(one, pairs.map(markOf), "diamond", colour("--now"));
    const chosen = chosenPair();
    if (chosen) drawRing(one, markOf(chosen));
  }

  function chosenPair() {
    return pairs.find((pair) => pair.mode === selection.current.mode);
  }

  function showMode() {
    const chosen = chosenPair();
    setText(readout, chosen ? spoken(chosen) : "Point at a mode to read it.");
    plot?.redraw(false);
  }

  /** @param {string} place */
  function summary(place) {
    const wanted = pairs.filter((pair) => pair.wantedHertz !== null);
    const first = `Spectrum at ${place}: ${pairs.length} modes of the solid from ${range(pairs.map((pair) => pair.hertz))}`;
    if (wanted.length === 0) return `${first}; none is wanted yet.`;
    return `${first}, ${wanted.length} wanted from ${range(wanted.flatMap(wantedHertz))}. The table of errors has the numbers.`;
  }

  connection.onBinary("bank", (header, arrays) => {
    bank = [header, arrays];
    show();
  });
  state.onChange((now, before) => {
    if (!now.solid) bank = null;
    if (!before || now.wanted !== before.wanted || now.targets !== before.targets) show();
  });
  selection.onChange((now, before) => {
    if (now.target !== before.target || (now.target === null && now.vertex !== before.vertex)) show();
    else if (now.mode !== before.mode) showMode();
  });
}

/**
 * Where the axis of levels begins: in steps, so that it does not move with every improvement.
 *
 * @param {Pair[]} pairs
 */
function floorOf(pairs) {
  const levels = pairs.flatMap((pair) => [pair.decibels, pair.wantedDecibels ?? 0]);
  const least = Math.min(0, ...levels.filter((level) => level > LOWEST_DECIBELS));
  return Math.max(LOWEST_DECIBELS, Math.min(-40, 20 * Math.floor((least - 5) / 20)));
}

/**
 * A mode in a sentence.
 *
 * @param {Pair} pair
 */
function spoken(pair) {
  const start = `Mode ${pair.mode + 1}: ${withHertz(pair.hertz)}, ${fixed(pair.decibels, 1)} dB`;
  if (pair.wantedHertz === null) return `${start}.`;
  const level = levelDifference(pair);
  const more = level === null ? "" : `, ${fixed(level, 1, true)} dB`;
  return `${start}; wanted ${withHertz(pair.wantedHertz)}: ${fixed(pair.cents, 1, true)} cents${more}.`;
}

/** @param {Pair} pair @returns {Mark} */
function markOf(pair) {
  return { hertz: pair.hertz, decibels: pair.decibels };
}

/** @param {Pair} pair @returns {Mark | null} */
function wantedMark(pair) {
  if (pair.wantedHertz === null) return null;
  return { hertz: pair.wantedHertz, decibels: pair.wantedDecibels ?? LOWEST_DECIBELS };
}

/** @param {Pair} pair @returns {number[]} */
function wantedHertz(pair) {
  return pair.wantedHertz === null ? [] : [pair.wantedHertz];
}

/** @param {number[]} hertz */
function range(hertz) {
  return `${withHertz(Math.min(...hertz))} to ${withHertz(Math.max(...hertz))}`;
}

/** @param {number | undefined} rigid motions of the solid as a whole that nothing resists @returns {string} */
function freedomOf(rigid) {
  if (rigid === undefined) return "";
  if (rigid === 0) return "Held: no rigid motion is left.";
  const left = rigid === 6 ? "Free: all 6 rigid motions are left" : `Partly held: ${rigid} rigid motion${rigid > 1 ? "s" : ""} of 6 left`;
  return `${left}, which do not sound.`;
}
