/** Plots whose colours are those of the page, as wide as their place, and marks in them. */

import uPlot from "uplot";

/** @typedef {{ hertz: number, decibels: number }} Mark a mode: its frequency and its level */
/** @typedef {"disc" | "diamond"} Shape discs are filled, diamonds open: told apart without colours */

const FONT = "12px system-ui, sans-serif";
const NEAR_PIXELS = 24;
const LABEL_PIXELS = 30;

/**
 * A colour of the page, or another custom property.
 *
 * @param {string} name such as `--plot-wanted`
 */
export function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim() || "#777777";
}

/**
 * Makes a plot that fills the width of its place and follows it, and the colours of the page.
 *
 * @param {HTMLElement} place
 * @param {number} height [px]
 * @param {Omit<uPlot.Options, "width" | "height">} options
 * @param {uPlot.AlignedData} data
 * @returns {uPlot}
 */
export function makePlot(place, height, options, data) {
  const width = () => Math.max(place.clientWidth, 200);
  const plot = new uPlot(
    {
      legend: { show: false },
      ...options,
      cursor: { drag: { x: false, y: false, setScale: false }, points: { show: false }, ...options.cursor },
      width: width(),
      height,
    },
    data,
    place,
  );
  const canvas = plot.root.querySelector("canvas");
  canvas?.setAttribute("aria-hidden", "true");
  new ResizeObserver(() => {
    if (place.clientWidth > 0 && width() !== plot.width) plot.setSize({ width: width(), height });
  }).observe(place);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => plot.redraw(false));
  return plot;
}

/**
 * An axis in the page's colours.
 *
 * @param {string} label
 * @param {Partial<uPlot.Axis>} [others]
 * @returns {uPlot.Axis}
 */
export function axis(label, others = {}) {
  const line = { stroke: () => colour("--plot-grid"), width: 1 };
  return {
    label,
    labelSize: 20,
    labelGap: 0,
    labelFont: FONT,
    font: FONT,
    stroke: () => colour("--plot-text"),
    grid: line,
    ticks: { ...line, size: 4 },
    ...others,
  };
}

/**
 * The axis of frequencies, logarithmic, without needless noughts.
 *
 * @returns {uPlot.Axis}
 */
export function hertzAxis() {
  return axis("Frequency [Hz]", {
    scale: "x",
    size: 34,
    splits: (_plot, _axis, low, high) => roundNumbers(low, high),
    filter: labelled,
    values: (_plot, splits) =>
      splits.map((hertz) => (hertz === null ? "" : hertz >= 1000 ? `${hertz / 1000}k` : String(hertz))),
  });
}

/**
 * All numbers of one significant digit between two others.
 *
 * @param {number} low
 * @param {number} high
 * @returns {number[]}
 */
export function roundNumbers(low, high) {
  const found = [];
  for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power += 1) {
    for (let digit = 1; digit < 10; digit += 1) {
      const value = Number(`${digit}e${power}`);
      if (value >= low && value <= high) found.push(value);
    }
  }
  return found;
}

/**
 * Leaves those numbers of an axis that have place for a label: of a decade 1, then 2 and 5, then all.
 *
 * @param {uPlot} plot
 * @param {number[]} splits
 * @returns {(number | null)[]}
 */
function labelled(plot, splits) {
  const { min, max } = plot.scales.x ?? {};
  if (!min || !max) return splits;
  const pixels = plot.bbox.width / uPlot.pxRatio / Math.log10(max / min);
  const [digits = "1"] = ["123456789", "12357", "125"].filter((each) => closest(each) * pixels > LABEL_PIXELS);
  return splits.map((value) => (digits.includes(value.toExponential().charAt(0)) ? value : null));
}

/**
 * The smallest distance of numbers with some first digits, as a share of a decade.
 *
 * @param {string} digits ascending
 */
function closest(digits) {
  const values = [...digits, "10"].map(Number);
  return Math.min(...values.slice(1).map((value, k) => Math.log10(value / (values[k] ?? 1))));
}

/**
 * Draws stems of modes and a mark on each.
 *
 * @param {uPlot} plot with scales `x` [Hz] and `y` [dB]
 * @param {readonly Mark[]} marks
 * @param {Shape} shape
 * @param {string} stroke colour
 * @param {(index: number) => boolean} [faint] which ones are drawn as left out
 */
export function drawStems(plot, marks, shape, stroke, faint) {
  const { ctx } = plot;
  const bottom = plot.bbox.top + plot.bbox.height;
  const size = 4.5 * uPlot.pxRatio;
  ctx.save();
  ctx.strokeStyle = stroke;
  ctx.fillStyle = stroke;
  marks.forEach((mark, index) => {
    const [x, y] = placeOf(plot, mark);
    ctx.globalAlpha = faint?.(index) ? 0.35 : 1;
    ctx.lineWidth = uPlot.pxRatio * (shape === "disc" ? 1 : 1.5);
    ctx.setLineDash(shape === "disc" ? [] : [3 * uPlot.pxRatio, 3 * uPlot.pxRatio]);
    ctx.beginPath();
    ctx.moveTo(x, bottom);
    ctx.lineTo(x, y);
    ctx.stroke();
    ctx.setLineDash([]);
    ctx.beginPath();
    if (shape === "disc") {
      ctx.arc(x, y, size, 0, 2 * Math.PI);
      if (!faint?.(index)) ctx.fill();
    } else {
      ctx.moveTo(x, y - 1.3 * size);
      ctx.lineTo(x + 1.3 * size, y);
      ctx.lineTo(x, y + 1.3 * size);
      ctx.lineTo(x - 1.3 * size, y);
      ctx.closePath();
    }
    ctx.stroke();
  });
  ctx.restore();
}

/**
 * Joins marks that belong together.
 *
 * @param {uPlot} plot
 * @param {readonly Mark[]} marks
 * @param {readonly Mark[]} others as many
 * @param {string} stroke colour
 */
export function joinPairs(plot, marks, others, stroke) {
  const { ctx } = plot;
  ctx.save();
  ctx.strokeStyle = stroke;
  ctx.lineWidth = uPlot.pxRatio;
  ctx.beginPath();
  marks.forEach((mark, index) => {
    const other = others[index];
    if (!other) return;
    ctx.moveTo(...placeOf(plot, mark));
    ctx.lineTo(...placeOf(plot, other));
  });
  ctx.stroke();
  ctx.restore();
}

/**
 * Draws a ring around a mark.
 *
 * @param {uPlot} plot
 * @param {Mark | undefined} mark
 */
export function drawRing(plot, mark) {
  if (!mark) return;
  const [x, y] = placeOf(plot, mark);
  plot.ctx.save();
  plot.ctx.strokeStyle = colour("--plot-text");
  plot.ctx.lineWidth = 2 * uPlot.pxRatio;
  plot.ctx.beginPath();
  plot.ctx.arc(x, y, 9 * uPlot.pxRatio, 0, 2 * Math.PI);
  plot.ctx.stroke();
  plot.ctx.restore();
}

/**
 * Which mark the pointer is at.
 *
 * @param {uPlot} plot
 * @param {readonly (Mark | undefined)[]} marks
 * @returns {number | null} its number; `null` if none is near
 */
export function nearestMark(plot, marks) {
  const { left = -1, top = -1 } = plot.cursor;
  if (left < 0) return null;
  let best = NEAR_PIXELS;
  /** @type {number | null} */
  let found = null;
  marks.forEach((mark, index) => {
    if (!mark) return;
    const across = plot.valToPos(mark.hertz, "x") - left;
    const along = plot.valToPos(Math.max(mark.decibels, lowest(plot)), "y") - top;
    // A stem may be pointed at all along, so what is beside it counts most.
    const distance = Math.hypot(across, along / 8);
    if (distance < best) {
      best = distance;
      found = index;
    }
  });
  return found;
}

/**
 * Bounds of an axis of frequencies that hold all of some.
 *
 * @param {readonly number[]} hertz
 * @returns {[number, number]}
 */
export function hertzRange(hertz) {
  const there = hertz.filter((value) => value > 0);
  if (there.length === 0) return [50, 10000];
  return [Math.min(...there) / 1.2, Math.max(...there) * 1.2];
}

/**
 * Where a mark is on the canvas; those too faint are at the bottom.
 *
 * @param {uPlot} plot
 * @param {Mark} mark
 * @returns {[number, number]}
 */
function placeOf(plot, mark) {
  const level = Math.max(mark.decibels, lowest(plot));
  return [plot.valToPos(mark.hertz, "x", true), plot.valToPos(level, "y", true)];
}

/** @param {uPlot} plot */
function lowest(plot) {
  return plot.scales.y?.min ?? -60;
}
