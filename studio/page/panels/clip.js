/** What was found in the selected target's clip: its spectrum, its modes, and which of them are used. */

import { ask, attempt, chosenTarget, clipOf } from "./chosen.js";
import { button, find, keepList, make, setAttribute, setText } from "./dom.js";
import { makeLegend } from "./legend.js";
import { decaySeconds, decibels, fixed, largest, withHertz } from "./numbers.js";
import { axis, colour, drawStems, hertzAxis, makePlot } from "./plots.js";
import { soundOfMode } from "./single.js";
import { makeZoom } from "./zoom.js";

/** @typedef {import("../types.js").Clip} Clip */
/** @typedef {import("../types.js").Target} Target */
/** @typedef {import("../types.js").ModeOfClip} ModeOfClip */
/** @typedef {{ hertz: number[], decibels: number[] }} Spectrum */

const HEIGHT = 220;
const LOWEST_DECIBELS = -90;
const SAME_HERTZ = 1e-6;

/**
 * Makes the view of a clip.
 *
 * @param {HTMLElement} element
 * @param {import("../main.js").Parts} parts
 */
export function makeClip(element, parts) {
  const { connection, state, selection } = parts;
  /** Spectra do not change: asked for once. @type {Map<string, Spectrum>} */
  const spectra = new Map();
  /** @type {import("uplot") | null} */
  let plot = null;
  /** @type {string | null} identifier of the clip that is drawn */
  let drawn = null;
  /** What was shown last: states come often while a search runs, and clips hardly change. */
  let shown = "";

  const zoom = makeZoom(() => plot, () => null);
  const none = make("p", { class: "hint" });
  const title = make("p", { class: "figure-line" });
  const picture = make("div", { class: "plot", role: "img" });
  const rows = make("tbody");
  const says = make("ul", { class: "says" });
  const allIn = button("Use all", () => void leaveOut(() => []));
  const table = make(
    "table",
    { class: "figures" },
    make("caption", { class: "hidden" }, "Modes of the clip"),
    make(
      "thead",
      {},
      make(
        "tr",
        {},
        make("th", { scope: "col" }, "Use"),
        heading("Frequency", "Hz"),
        heading("Damping", "1/s"),
        heading("60 dB in", "s"),
        heading("Level", "dB"),
        make("th", { scope: "col" }, make("span", { class: "hidden" }, "Hear it alone")),
      ),
    ),
    rows,
  );
  const body = make(
    "div",
    { hidden: true },
    title,
    makeLegend([
      { sign: "line", text: "clip", kind: "clip-line" },
      { sign: "disc", text: "modes found", kind: "wanted" },
    ]),
    picture,
    zoom.buttons,
    says,
    make(
      "details",
      { class: "more" },
      make("summary", {}, "Modes of the clip"),
      make("div", { class: "scroll", tabindex: 0, role: "group", "aria-label": "Modes of the clip" }, table),
      make("div", { class: "row" }, allIn),
    ),
  );
  element.append(none, body);

  /**
   * @param {(without: number[]) => number[]} change of the frequencies that are left out
   */
  async function leaveOut(change) {
    const target = chosenTarget(parts);
    if (!target) return;
    const without = change(target.without);
    if (!(await ask(parts, "change_target", { target: target.name, without }))) show();
  }

  /** @param {ModeOfClip} mode */
  function create(mode) {
    const box = make("input", {
      type: "checkbox",
      "aria-label": `Use ${withHertz(mode.hertz)}`,
      onchange: () =>
        void leaveOut((without) => {
          const others = without.filter((hertz) => !isSame(hertz, mode.hertz));
          return box.checked ? others : [...others, mode.hertz];
        }),
    });
    const figures = ["hertz", "damping", "decay", "loudness"].map((name) => make("td", { class: `number ${name}` }));
    const sound = button("\u25b6\ufe0e", () => void playMode(mode), {
      class: "small",
      "aria-label": `${withHertz(mode.hertz)} alone`,
    });
    return make("tr", {}, make("td", {}, make("label", { class: "tick" }, box)), ...figures, make("td", {}, sound));
  }

  /** @param {ModeOfClip} mode */
  async function playMode(mode) {
    await attempt(parts, () => parts.player.play(soundOfMode(mode)));
  }

  function show() {
    const target = chosenTarget(parts);
    const clip = clipOf(state.current, target);
    const isReady = clip?.phase === "ready";
    shown = JSON.stringify([target, clip]);
    none.hidden = isReady;
    body.hidden = !isReady;
    if (!clip || !target || !isReady) {
      setText(none, whyNone(target, clip));
      drawn = null;
      return;
    }
    const loudest = largest(clip.modes.map((mode) => mode.amplitude));
    const used = clip.modes.filter((mode) => !isLeftOut(target, mode));
    setText(
      title,
      `${clip.name}: ${Math.min(used.length, target.modes ?? used.length)} of ${clip.modes.length} modes used; all explain ${fixed(100 * clip.explained, 2)} % of the energy`,
    );
    keepList(rows, clip.modes, (mode) => String(mode.hertz), create, (row, mode) => update(row, mode, target, loudest));
    keepList(says, clip.says, (_text, index) => String(index), () => make("li"), setText);
    says.hidden = clip.says.length === 0;
    allIn.disabled = used.length === clip.modes.length;
    setAttribute(picture, "aria-label", summary(clip, used));
    void draw(clip);
  }

  /**
   * @param {HTMLElement} row
   * @param {ModeOfClip} mode
   * @param {Target} target
   * @param {number} loudest
   */
  function update(row, mode, target, loudest) {
    const isOut = isLeftOut(target, mode);
    find(row, "input", HTMLInputElement).checked = !isOut;
    row.classList.toggle("left-out", isOut);
    setText(find(row, ".hertz", HTMLElement), fixed(mode.hertz, 1));
    setText(find(row, ".damping", HTMLElement), fixed(mode.damping_per_second, 1));
    setText(find(row, ".decay", HTMLElement), fixed(decaySeconds(mode.damping_per_second), 2));
    setText(find(row, ".loudness", HTMLElement), fixed(decibels(mode.amplitude, loudest), 1));
  }

  /** @param {Clip} clip */
  async function draw(clip) {
    let spectrum = spectra.get(clip.clip);
    if (!spectrum) {
      if (drawn === clip.clip) return;
      drawn = clip.clip;
      await attempt(parts, async () => {
        spectrum = await connection.json(`/clip/${encodeURIComponent(clip.clip)}/spectrum`);
      });
      if (!spectrum) {
        drawn = null;
        return;
      }
      spectra.set(clip.clip, spectrum);
      // Another one may have been selected meanwhile.
      if (clipOf(state.current, chosenTarget(parts))?.clip !== clip.clip) return;
    }
    drawn = clip.clip;
    const hertz = spectrum.hertz.map((value, index) => /** @type {[number, number]} */ ([value, spectrum?.decibels[index] ?? 0]));
    const there = hertz.filter(([value]) => value > 0);
    plot ??= createPlot();
    plot.setData([there.map(([value]) => value), there.map(([, level]) => level)]);
  }

  function createPlot() {
    return makePlot(
      picture,
      HEIGHT,
      {
        scales: {
          x: { time: false, distr: 3, range: (_one, low, high) => zoom.range([Math.max(low ?? 20, 20), high ?? 20000]) },
          y: { range: [LOWEST_DECIBELS, 6] },
        },
        axes: [hertzAxis(), axis("Level [dB]", { size: 42 })],
        series: [{}, { label: "clip", stroke: () => colour("--plot-clip"), width: 1, points: { show: false } }],
        cursor: zoom.cursor,
        hooks: { draw: [drawModes], setSelect: [zoom.select] },
      },
      [[20, 20000], [null, null]],
    );
  }

  /** @param {import("uplot")} one */
  function drawModes(one) {
    const target = chosenTarget(parts);
    const clip = clipOf(state.current, target);
    if (!clip || !target) return;
    const levels = spectra.get(clip.clip);
    const marks = clip.modes.map((mode) => ({
      hertz: mode.hertz,
      decibels: levels ? levelAt(levels, mode.hertz) : LOWEST_DECIBELS,
    }));
    drawStems(one, marks, "disc", colour("--wanted"), (index) => {
      const mode = clip.modes[index];
      return mode !== undefined && isLeftOut(target, mode);
    });
  }

  state.onChange((now) => {
    const target = chosenTarget(parts);
    if (shown !== JSON.stringify([target, clipOf(now, target)])) show();
  });
  selection.onChange((now, before) => {
    if (now === before || now.target !== before.target) show();
  });
}

/**
 * @param {Target} target
 * @param {ModeOfClip} mode
 */
function isLeftOut(target, mode) {
  return target.without.some((hertz) => isSame(hertz, mode.hertz));
}

/**
 * Whether two frequencies are those of one mode.
 *
 * @param {number} one
 * @param {number} other
 */
function isSame(one, other) {
  return Math.abs(one - other) <= SAME_HERTZ * other;
}

/**
 * Level of the spectrum's peak at a frequency, so that a mode's mark is on its line.
 *
 * @param {Spectrum} spectrum with ascending frequencies
 * @param {number} hertz
 */
function levelAt(spectrum, hertz) {
  const { length } = spectrum.hertz;
  let low = 0;
  let high = length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if ((spectrum.hertz[middle] ?? 0) < hertz) low = middle;
    else high = middle;
  }
  let level = -Infinity;
  for (let k = Math.max(0, low - 1); k <= Math.min(length - 1, high + 1); k += 1) {
    level = Math.max(level, spectrum.decibels[k] ?? -Infinity);
  }
  return level;
}

/**
 * @param {Target | null} target
 * @param {Clip | null} clip
 */
function whyNone(target, clip) {
  if (!target) return "Select a target to see what is in its clip.";
  if (!clip) return `${target.name} has no clip yet.`;
  if (clip.phase === "failed") return clip.message ?? `${clip.name} could not be read.`;
  if (clip.phase === "stopped") return `The search for the modes of ${clip.name} was stopped.`;
  return `The modes of ${clip.name} are being found \u2026`;
}

/**
 * @param {Clip} clip
 * @param {ModeOfClip[]} used
 */
function summary(clip, used) {
  const hertz = used.map((mode) => mode.hertz);
  const range = hertz.length ? ` from ${withHertz(Math.min(...hertz))} to ${withHertz(Math.max(...hertz))}` : "";
  return `Spectrum of ${clip.name} with ${used.length} modes${range}. The table below has the numbers.`;
}

/**
 * @param {string} text
 * @param {string} unit
 */
function heading(text, unit) {
  return make("th", { scope: "col", class: "number" }, text, make("br"), make("small", {}, unit));
}
