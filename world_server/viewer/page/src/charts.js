// SPDX-License-Identifier: MIT
// Strip charts of the last seconds: one canvas each, per pixel the least and the greatest value, so
// that no peak is lost between pixels.
import { POINTER, POINTER_NUMBERS, TICK, TICK_NUMBERS } from "./decode.js";

export const WINDOW_NS = 5e9;
const HEIGHT = 54; // px

/** How much later than after one `period` tick i followed the one before, ns. */
export function lateness(ticks, i, period) {
  return Math.max(0, ticks.at(i, TICK.duration) - period);
}

function force(ticks, i) {
  let greatest = 0;
  for (let p = 0; p < ticks.pointers; ++p) {
    const at = TICK_NUMBERS + p * POINTER_NUMBERS + POINTER.force;
    greatest = Math.max(greatest, Math.hypot(ticks.at(i, at), ticks.at(i, at + 1), ticks.at(i, at + 2)));
  }
  return greatest;
}

const CHARTS = [
  { title: "force", unit: "N", least: 1, lines: [["force", force]] },
  { title: "penetration", unit: "mm", least: 1, lines: [["depth", (ticks, i) => 1e3 * ticks.penetration(i)]] },
  { title: "feature age", unit: "ms", least: 50, lines: [["age", (ticks, i) => 1e3 * ticks.at(i, TICK.featureAge)]] },
  { title: "loop lateness", unit: "ms", least: 1, lines: [["late", (ticks, i, period) => 1e-6 * lateness(ticks, i, period)]] },
  {
    title: "impulse",
    unit: "N s",
    least: 0.1,
    lines: [
      ["displayed", (ticks, i) => ticks.displayed(i)],
      ["received", (ticks, i) => ticks.receivedImpulse(i)],
    ],
    total: true, // a sum that only grows: what matters is how it grew within the window
  },
];

export class Charts {
  /** @param {HTMLElement} parent */
  constructor(parent) {
    this.#charts = CHARTS.map((chart) => {
      const figure = document.createElement("figure");
      const caption = document.createElement("figcaption");
      const canvas = document.createElement("canvas");
      const name = document.createElement("span");
      const value = document.createElement("output");
      name.textContent = `${chart.title} [${chart.unit}]`;
      canvas.setAttribute("role", "img");
      canvas.setAttribute("aria-label", `strip chart of ${chart.title} in ${chart.unit}`);
      caption.append(name, value);
      figure.append(caption, canvas);
      parent.append(figure);
      return { ...chart, canvas, value };
    });
  }
  #charts;

  /** Draws the window that ends at `time`; `period` [ns] of the haptic loop. */
  draw(ticks, time, period) {
    const colours = getComputedStyle(document.documentElement);
    const last = ticks.indexAt(time);
    const first = Math.max(ticks.first, ticks.indexAt(time - WINDOW_NS));
    for (const chart of this.#charts) drawChart(chart, { ticks, time, period, first, last, colours });
  }
}

function drawChart({ canvas, value, lines, least, total }, { ticks, time, period, first, last, colours }) {
  const scale = Math.min(devicePixelRatio, 2);
  const width = Math.max(1, Math.round(canvas.clientWidth * scale));
  const height = HEIGHT * scale;
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  const context = canvas.getContext("2d");
  context.clearRect(0, 0, width, height);
  const bands = lines.map(([, read]) => band(ticks, time, period, first, last, width, read));
  let top = least;
  let bottom = total ? Infinity : 0;
  for (const { low, high } of bands) {
    for (let x = 0; x < width; ++x) {
      top = Math.max(top, high[x]);
      if (total) bottom = Math.min(bottom, low[x]);
    }
  }
  if (total && bottom < Infinity) top = Math.max(...bands.map(({ newest }) => newest || 0), bottom + least);
  if (bottom === Infinity) bottom = 0;
  const y = (v) => height - 1 - ((v - bottom) / (top - bottom)) * (height - 3);
  bands.forEach(({ low, high }, k) => {
    context.strokeStyle = colours.getPropertyValue(`--line-${k}`);
    context.lineWidth = scale;
    context.beginPath();
    let before = NaN; // where the line stands, so that it has no gaps between pixels
    for (let x = 0; x < width; ++x) {
      if (low[x] > high[x]) continue;
      if (Number.isNaN(before)) context.moveTo(x, y(low[x]));
      else context.lineTo(x, y(low[x]));
      context.lineTo(x, y(high[x]));
      before = high[x];
    }
    context.stroke();
  });
  context.fillStyle = colours.getPropertyValue("--muted");
  context.font = `${10 * scale}px sans-serif`;
  context.fillText(show(top), 2 * scale, 10 * scale);
  value.textContent = bands
    .map(({ newest }, k) => (lines.length > 1 ? `${lines[k][0]} ` : "") + (Number.isNaN(newest) ? "-" : show(newest)))
    .join("  ");
}

function show(v) {
  return v.toFixed(v >= 100 ? 0 : v >= 10 ? 1 : v >= 1 ? 2 : 3);
}

/** Least and greatest value per pixel (low > high: none), and the newest that is a number. */
function band(ticks, time, period, first, last, width, read) {
  const low = new Float64Array(width).fill(Infinity);
  const high = new Float64Array(width).fill(-Infinity);
  let newest = NaN;
  for (let i = first; i <= last; ++i) {
    const v = read(ticks, i, period);
    if (Number.isNaN(v)) continue;
    newest = v;
    const x = Math.floor((1 - (time - ticks.at(i, TICK.start)) / WINDOW_NS) * (width - 1));
    if (x < 0) continue;
    if (v < low[x]) low[x] = v;
    if (v > high[x]) high[x] = v;
  }
  return { low, high, newest };
}
