// SPDX-License-Identifier: Apache-2.0
// Draws the charts of a report with uPlot, each from the JSON beside its title. Dragging zooms all
// charts of the same span of x, a double click shows all of it again.
"use strict";

const LOOKS = { measured: "--blue", reference: "--orange", error: "--red", output: "--green", before: "--quiet" };
const FONT = "11px system-ui, sans-serif";

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const shown = (value, unit) => (value == null ? "–" : `${value.toPrecision(5).replace("-", "−")} ${unit}`);

/** 1, 2, 5, 10, … between two values. */
function decades(low, high) {
  const marks = [];
  for (let power = 10 ** Math.floor(Math.log10(low)); power <= high; power *= 10) marks.push(power, 2 * power, 5 * power);
  return marks.filter((mark) => mark >= low && mark <= high);
}

/** Numbers on an axis; the last one has the unit. */
const numbers = (unit) => (_, ticks) => ticks.map((tick, k) => `${+tick.toPrecision(6)}${k === ticks.length - 1 ? ` ${unit}` : ""}`.replace("-", "−"));

/** Modes as a strip above the field, limits and named places in it. */
function overlay(plot, chart) {
  const { ctx, bbox } = plot, px = devicePixelRatio, { min, max } = plot.scales.x;
  const at = (value, scale) => plot.valToPos(value, scale, true);
  const line = (x0, y0, x1, y1) => { ctx.beginPath(); ctx.moveTo(x0, y0); ctx.lineTo(x1, y1); ctx.stroke(); };
  ctx.save();
  for (const [begin, end, fill] of chart.spans) {
    if (end <= min || begin >= max) continue;
    const left = at(Math.max(begin, min), "x"), right = at(Math.min(end, max), "x");
    ctx.fillStyle = fill;
    ctx.fillRect(left, bbox.top - 5 * px, right - left, 4 * px);
  }
  ctx.lineWidth = px;
  ctx.textAlign = "left";
  ctx.textBaseline = "alphabetic";
  ctx.font = `${11 * px}px system-ui, sans-serif`;
  ctx.setLineDash([2 * px, 4 * px]);
  ctx.strokeStyle = colour("--red");
  for (const value of chart.limits) {
    if (value < chart.yRange[0] || value > chart.yRange[1]) continue;
    const y = at(value, "y");
    line(bbox.left, y, bbox.left + bbox.width, y);
  }
  for (const [value, name] of chart.marks) {
    if (value < min || value > max) continue;
    const x = at(value, "x");
    ctx.setLineDash(name === "fault" ? [] : [px, 4 * px]);
    ctx.strokeStyle = ctx.fillStyle = colour(name === "fault" ? "--red" : "--quiet");
    line(x, bbox.top, x, bbox.top + bbox.height);
    ctx.fillText(name, x + 3 * px, bbox.top + bbox.height - 6 * px);
  }
  ctx.restore();
}

function draw(figure, chart) {
  const axis = { stroke: colour("--quiet"), font: FONT, grid: { stroke: colour("--line"), width: 1 }, ticks: { show: false } };
  const [low, high] = chart.xRange;
  const series = chart.series.map(({ label, kind }) => ({
    label, stroke: colour(LOOKS[kind]), width: 1.6, dash: kind === "reference" ? [5, 3] : [],
    points: { show: false }, value: (_, value) => shown(value, chart.unit),
  }));
  return new uPlot({
    width: figure.clientWidth, height: chart.height, padding: [8, 12, 0, 0],
    cursor: { sync: { key: `${low} ${high} ${chart.xUnit}` }, y: false, points: { size: 5 } },
    scales: {
      x: { time: false, distr: chart.logarithmic ? 3 : 1, range: (_, from, to) => (to > from ? [from, to] : [low, high]) },
      y: { range: chart.yRange },
    },
    axes: [
      { ...axis, size: 24, values: numbers(chart.xUnit), ...(chart.logarithmic && { splits: (_, axis, from, to) => decades(from, to), filter: (_, ticks) => ticks }) },
      { ...axis, size: 64, values: numbers("") },
    ],
    series: [{ label: chart.xUnit === "s" ? "at" : "f", value: (_, value) => shown(value, chart.xUnit) }, ...series],
    hooks: { draw: [(plot) => overlay(plot, chart)] },
  }, chart.data, figure);
}

// A chart is drawn once it has a width: not before its joint is unfolded.
const plots = new Map();
const observer = new ResizeObserver((entries) => {
  for (const { target, contentRect: { width } } of entries) {
    if (width < 1) continue;
    const plot = plots.get(target);
    if (!plot) plots.set(target, draw(target, JSON.parse(target.querySelector("script").textContent)));
    else if (Math.abs(plot.width - width) >= 1) plot.setSize({ width, height: plot.height });
  }
});
for (const figure of document.querySelectorAll("figure.chart")) observer.observe(figure);
