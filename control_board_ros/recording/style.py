# SPDX-License-Identifier: Apache-2.0
"""Look of a report, and the script that shows the values under the pointer."""

from __future__ import annotations

STYLE = """
:root { color-scheme: light dark; --ink: #1c2430; --quiet: #66707d; --paper: #fff; --card: #f5f7f9;
  --line: #d9dee4; --blue: #1f6fd0; --orange: #e07b00; --red: #d02c2c; --green: #2c8a4b; }
@media (prefers-color-scheme: dark) { :root { --ink: #e4e8ee; --quiet: #98a2b0; --paper: #14181d;
  --card: #1d232a; --line: #363f4a; --blue: #62a5ff; --orange: #ffa63d; --red: #ff6b6b;
  --green: #62c983; } }
body { margin: 0; background: var(--paper); color: var(--ink);
  font: 14px/1.45 system-ui, "Segoe UI", Roboto, "Noto Sans", sans-serif; }
main { max-width: 1180px; margin: 0 auto; padding: 16px 20px 40px; }
h1 { font-size: 22px; margin: 8px 0 2px; } h2 { font-size: 18px; margin: 22px 0 8px; }
h3 { font-size: 15px; margin: 20px 0 6px; }
.tiles { display: flex; flex-wrap: wrap; gap: 8px; }
.tile { background: var(--card); border-radius: 8px; padding: 7px 14px; font-weight: 600;
  font-variant-numeric: tabular-nums; }
.tile span { display: block; color: var(--quiet); font-size: 11.5px; font-weight: 400; }
.tile.bad { color: var(--red); }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: 12.5px; }
th { color: var(--quiet); font-weight: 500; position: sticky; top: 0; background: var(--paper); }
th, td { padding: 3px 9px; text-align: right; border-bottom: 1px solid var(--line);
  white-space: nowrap; }
td:nth-child(2), td:nth-child(3), th:nth-child(2), th:nth-child(3) { text-align: left; }
table.text td:last-child, table.text th:last-child { text-align: left; white-space: normal; }
svg { display: block; width: 100%; height: auto; margin: 4px 0 2px; }
.chart .frame { fill: var(--card); } .chart .grid { stroke: var(--line); stroke-width: 1; }
.tick { fill: var(--quiet); font-size: 11px; } .title { fill: var(--ink); font-size: 12.5px; font-weight: 600; }
.line { fill: none; stroke-width: 1.6; stroke-linejoin: round; stroke: var(--blue); }
.line.reference { stroke: var(--orange); stroke-dasharray: 5 3; }
.line.error { stroke: var(--red); } .line.output { stroke: var(--green); }
.line.before { stroke: var(--quiet); }
.limit { stroke: var(--red); stroke-dasharray: 2 4; } .mark { stroke: var(--quiet); stroke-dasharray: 1 4; }
.fault { stroke: var(--red); } text.mark, text.fault { stroke: none; } text.fault { fill: var(--red); }
.faultmark { fill: #ff1f1f; stroke: #fff; } .cursor { stroke: var(--quiet); }
.legend { margin: 2px 0 8px; } .key { margin-right: 16px; color: var(--quiet); font-size: 12px; }
.key i { display: inline-block; width: 12px; height: 12px; border-radius: 3px; margin-right: 5px;
  vertical-align: -1px; border: 1px solid var(--line); }
details.joint { border-top: 1px solid var(--line); padding: 6px 0; margin-top: 8px; }
summary { cursor: pointer; } .quiet { color: var(--quiet); margin-left: 8px; }
#values { position: fixed; pointer-events: none; background: var(--ink); color: var(--paper);
  padding: 4px 9px; border-radius: 6px; font-size: 12px; white-space: pre; display: none;
  font-variant-numeric: tabular-nums; }
footer { margin-top: 26px; color: var(--quiet); font-size: 12px; }
@media print { details.joint { break-inside: avoid; } }
"""  # noqa: E501

#: Reads values back from the paths: no second copy of the data in the file.
SCRIPT = """
const box = document.body.appendChild(Object.assign(document.createElement("div"), {id: "values"}));
const pair = (svg, key) => svg.dataset[key].split(" ").map(Number);
const points = new WeakMap();
function pointsOf(path) {
  if (!points.has(path))
    points.set(path, [...path.getAttribute("d").matchAll(/[ML]([-\\d.]+) ([-\\d.]+)/g)].map(m => [+m[1], +m[2]]));
  return points.get(path);
}
function valueOf(svg, key, place) {
  const [low, high, from, to] = pair(svg, key), share = (place - from) / (to - from);
  return key === "x" && svg.dataset.scale === "log" ? low * (high / low) ** share : low + share * (high - low);
}
function show(svg, x, event) {
  const [, , left, right] = pair(svg, "x"), [, , bottom, top] = pair(svg, "y");
  const cursor = svg.querySelector(".cursor");
  if (x < left || x > right) { hide(); return; }
  for (const [k, v] of Object.entries({x1: x, x2: x, y1: top, y2: bottom})) cursor.setAttribute(k, v);
  const [xUnit, unit] = svg.dataset.units.split(" ");
  const lines = [valueOf(svg, "x", x).toPrecision(5) + " " + xUnit];
  for (const path of svg.querySelectorAll(".line[data-label]")) {
    const near = pointsOf(path).reduce((a, b) => !a || Math.abs(b[0] - x) < Math.abs(a[0] - x) ? b : a, null);
    if (near && Math.abs(near[0] - x) < 12)
      lines.push(path.dataset.label + "  " + valueOf(svg, "y", near[1]).toPrecision(5) + " " + unit);
  }
  box.textContent = lines.join("\\n");
  const turn = event.clientX > innerWidth - 230;
  Object.assign(box.style, {display: "block", top: event.clientY + 14 + "px",
    left: turn ? "" : event.clientX + 14 + "px", right: turn ? innerWidth - event.clientX + 14 + "px" : ""});
}
function hide() {
  box.style.display = "none";
  for (const line of document.querySelectorAll(".cursor")) { line.setAttribute("y1", 0); line.setAttribute("y2", 0); }
}
for (const svg of document.querySelectorAll("svg.chart")) {
  svg.addEventListener("pointermove", event => {
    const frame = svg.getBoundingClientRect(), x = (event.clientX - frame.left) / frame.width * svg.viewBox.baseVal.width;
    hide();
    show(svg, x, event);
  });
  svg.addEventListener("pointerleave", hide);
}
"""  # noqa: E501
