// SPDX-License-Identifier: Apache-2.0
// @ts-check
// The freeze frame of a fault: measurements and references around it, as small charts.

import { h } from "./dom.js";
import { unitOf } from "./units.js";

const WIDTH = 240, HEIGHT = 64;
// Title, measured signal, reference.
const CHARTS = [
  ["Position", "position", "position_reference"], ["Torque", "torque", "torque_reference"],
  ["Current", "current", null], ["Output", "output", null],
];

function shape(name, attributes) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  return element;
}

function line(times, values, x, y, followed) {
  const points = times.map((time, k) =>
    (values[k] === null ? null : `${x(time).toFixed(1)},${y(values[k]).toFixed(1)}`)).filter(Boolean);
  return shape("polyline", { points: points.join(" "), class: followed ? "followed" : "measured" });
}

/** @param {string[]} row @param {Columns} rows @param {boolean} sliding */
function chart([title, measured, followed], rows, sliding) {
  const times = rows.time, [factor, unit] = unitOf(measured, sliding);
  const values = [rows[measured], followed ? rows[followed] : []].flat().filter((value) => value !== null);
  if (!values.length) return null; // no such sensor
  let low = Math.min(...values), high = Math.max(...values);
  if (high - low < 1e-6) { low -= 0.5; high += 0.5; }
  const x = (time) => (WIDTH * (time - times[0])) / (times.at(-1) - times[0] || 1);
  const y = (value) => HEIGHT - 2 - ((HEIGHT - 4) * (value - low)) / (high - low);
  const svg = shape("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, "aria-hidden": "true" });
  svg.append(shape("line", { x1: x(0), x2: x(0), y1: 0, y2: HEIGHT, class: "instant" }));
  if (followed) svg.append(line(times, rows[followed], x, y, true));
  svg.append(line(times, rows[measured], x, y, false));
  return h("figure", {}, svg,
    h("figcaption", {}, `${title} ${(factor * low).toPrecision(3)} to ${(factor * high).toPrecision(3)} ${unit}`));
}

/** The charts of a freeze frame; vertical line: the fault, dashed: the reference. @param {Columns} rows */
export function frameCharts(rows, sliding) {
  const from = rows.time[0].toFixed(1), to = rows.time.at(-1).toFixed(1);
  return h("div", { class: "frame", role: "group", "aria-label": `From ${from} s to ${to} s around the fault` },
    ...CHARTS.map((row) => chart(row, rows, sliding)));
}
