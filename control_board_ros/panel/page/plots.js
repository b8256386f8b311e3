// SPDX-License-Identifier: Apache-2.0
// @ts-check
// Live plots of any signals: one chart per unit, one time axis, one cursor.

import { button, download, h, icon, segmented } from "./dom.js";
import { LABELS, unitOf } from "./units.js";

const WINDOWS = { 5: "5 s", 20: "20 s", 60: "60 s" };
const HEIGHT = 150; // px
const MOST = 12; // signals
// Drawn with a signal, dashed.
const BESIDE = { position: "position_reference", velocity: "velocity_reference", torque: "torque_reference" };
// Modes with such a reference; in others none is drawn.
const FOLLOWS = {
  position: (mode) => ["pos", "posd", "mix", "vel", "veld"].includes(mode),
  velocity: (mode) => ["pos", "mix", "vel", "veld"].includes(mode),
  torque: (mode) => mode === "torq",
};
const COLOURS = ["#4c9be8", "#e8964c", "#5cba7d", "#d8636f", "#a884e0", "#c9b23e", "#45b5bd", "#d77fb8", "#8f9aa8",
  "#b08357", "#6f86f0", "#7fae3c"];

// Minimum span of a chart, by unit: noise stays small.
const LEAST = { "°": 2, rad: 0.02, "°/s": 2, "rad/s": 0.05, mm: 2, "mm/s": 2, "N·m": 1, N: 1, "%": 2, A: 0.2, "°C": 2 };

function wide(low, high, least) {
  if (low === null || high === null) return [0, least];
  const more = Math.max(least - (high - low), 0.1 * (high - low)) / 2;
  return [low - more, high + more];
}

export class Plots {
  /** @param {HTMLElement} element @param {Panel} panel */
  constructor(element, panel) {
    this.panel = panel;
    this.element = element;
    /** @type {Plotted[]} */
    this.signals = [];
    this.charts = [];
    this.paused = this.dirty = false;
    this.window = 20; // s
    this.windows = h("div", { class: "segmented small", role: "radiogroup", "aria-label": "Time shown" });
    this.pauseButton = button("ghost", null, () => this.pause(!this.paused));
    this.png = button("small-button", "Save the plots as PNG", () => this.savePicture(), "PNG");
    this.csv = button("small-button", "Save the plots as CSV", () => this.saveTable(), "CSV");
    this.adder = h("select", { "aria-label": "Add a signal of all joints shown", onchange: () => this.addAll() },
      h("option", { value: "" }, "Add …"),
      ...Object.entries(LABELS).map(([signal, label]) => h("option", { value: signal }, label)));
    this.clearButton = button("small-button", "Remove all plots", () => this.clear(), "Clear");
    this.body = h("div", { class: "charts" });
    this.legend = h("ul", { class: "legend", "aria-label": "Signals in the plots" });
    element.replaceChildren(h("header", {}, h("h2", {}, "Plots"), this.adder, this.windows, this.pauseButton, this.png,
      this.csv, this.clearButton), this.legend, this.body);
    this.pause(false);
    this.drawWindows();
    this.rebuild();
    new ResizeObserver(() => this.resize()).observe(this.body);
  }

  drawWindows() {
    segmented(this.windows, "Time shown", WINDOWS, String(this.window),
      (seconds) => { this.window = Number(seconds); this.drawWindows(); });
  }

  addAll() {
    const signal = this.adder.value;
    this.adder.value = "";
    if (signal) for (const { joint } of this.panel.cards.slice(0, MOST)) if (!this.find(joint, signal))
      this.add(joint, signal);
  }

  /** The boards whose signals are plotted, also hidden ones: their states are received. */
  get boards() {
    const { model } = this.panel;
    return [...new Set(this.signals.map((s) => model.boards.get(s.board)))].filter(Boolean);
  }

  /** A joint and a signal for display; with the board if several are plotted. @param {Plotted} s */
  nameOf(s) {
    const { model } = this.panel;
    const board = model.boards.get(s.board);
    const of = this.boards.length > 1 && board ? `${model.titleOf(board)} ` : "";
    return `${of}${s.joint.short} ${LABELS[s.signal].toLowerCase()}`;
  }

  /** @param {Joint} joint @param {string} signal */
  find(joint, signal) { return this.signals.find((s) => s.joint.key === joint.key && s.signal === signal); }

  toggle(joint, signal) {
    const there = this.find(joint, signal);
    if (there) this.remove(there); else this.add(joint, signal);
  }

  add(joint, signal) {
    if (this.signals.length >= MOST) this.signals.shift();
    const used = new Set(this.signals.map((s) => s.colour));
    this.signals.push({ joint, board: joint.board.name, signal, colour: COLOURS.find((c) => !used.has(c)) ?? COLOURS[0],
      times: [], values: [], beside: BESIDE[signal] ?? null, references: [] });
    this.rebuild();
    this.panel.watch();
  }

  remove(signal) { this.signals = this.signals.filter((s) => s !== signal); this.rebuild(); this.panel.watch(); }

  clear() { this.signals = []; this.rebuild(); this.panel.watch(); }

  pause(paused) {
    this.paused = paused;
    this.pauseButton.replaceChildren(icon(paused ? "play" : "pause"));
    this.pauseButton.setAttribute("aria-label", paused ? "Go on plotting" : "Pause the plots");
    this.pauseButton.setAttribute("aria-pressed", String(paused));
  }

  /** Add a state of a board. @param {Board} board */
  take(board) {
    if (this.paused) return;
    for (const s of this.signals) {
      if (s.board !== board.name) continue;
      const state = board.joint(s.joint.name)?.state;
      const known = (value) => (Number.isFinite(value) ? value : null);
      if (s.times.length && board.stamp < s.times.at(-1)) s.times.length = s.values.length = s.references.length = 0;
      if (board.stamp === s.times.at(-1)) continue;
      s.times.push(board.stamp);
      s.values.push(known(state?.[s.signal]));
      if (s.beside) s.references.push(FOLLOWS[s.signal](s.joint.mode) ? known(state?.[s.beside]) : null);
      this.dirty = true;
      if (s.times[0] < board.stamp - 90) for (const kept of [s.times, s.values, s.references]) kept.splice(0, 300);
    }
  }

  rebuild() {
    for (const { plot } of this.charts) plot.destroy();
    const units = new Map();
    for (const s of this.signals) {
      const unit = unitOf(s.signal, s.joint.sliding)[1];
      units.set(unit, [...(units.get(unit) ?? []), s]);
    }
    this.body.replaceChildren();
    this.charts = [...units].map(([unit, signals]) => ({ unit, signals, plot: this.chart(unit, signals) }));
    this.legend.replaceChildren(...this.signals.map((s) => {
      const dot = h("span", { class: "dot" });
      dot.style.background = s.colour;
      const name = this.nameOf(s);
      return h("li", {}, dot, h("span", {}, name, s.beside ? h("span", { class: "beside" }, "– – reference") : null),
        button("ghost", `Remove ${name} from the plots`, () => this.remove(s), icon("close")));
    }));
    for (const action of [this.png, this.csv, this.clearButton, this.pauseButton])
      action.disabled = !this.signals.length;
    if (!this.signals.length)
      this.body.replaceChildren(h("p", { class: "hint" },
        "Press a value of a joint to plot it, with its reference beside it."));
    this.dirty = true;
  }

  chart(unit, signals) {
    const style = getComputedStyle(document.documentElement);
    const ink = style.getPropertyValue("--dim").trim();
    const grid = { stroke: style.getPropertyValue("--line").trim(), width: 1 };
    const axis = { stroke: ink, grid, ticks: { show: false }, font: "11px system-ui, sans-serif" };
    return new window.uPlot({
      width: Math.max(this.body.clientWidth, 200), height: HEIGHT, legend: { show: false }, pxAlign: 0,
      cursor: { sync: { key: "panel" }, drag: { x: false, y: false }, points: { size: 6 } },
      scales: { x: { time: false }, y: { range: (_, low, high) => wide(low, high, LEAST[unit] ?? 1) } },
      axes: [
        { ...axis, size: 26, values: (_, ticks) => ticks.map((t) => (t === 0 ? "now" : `${t} s`.replace("-", "−"))) },
        { ...axis, size: 54, label: unit, labelSize: 14, labelFont: "11px system-ui, sans-serif", labelGap: 0 }],
      series: [{}, ...curves(signals).map(({ s, reference }) => ({
        label: this.nameOf(s), stroke: s.colour, width: reference ? 1.1 : 1.6,
        dash: reference ? [5, 4] : undefined, points: { show: false }, spanGaps: !reference }))],
      plugins: [{ hooks: { setCursor: [(plot) => this.readout(plot, unit, signals)] } }],
    }, [[], ...curves(signals).map(() => [])], this.body);
  }

  readout(plot, unit, signals) {
    const { idx } = plot.cursor;
    let box = plot.over.querySelector(".readout-box");
    if (!box) { box = h("div", { class: "readout-box" }); plot.over.append(box); }
    box.hidden = idx === null || idx === undefined;
    if (box.hidden) return;
    const time = plot.data[0][idx];
    const rows = curves(signals).map(({ s, reference }, k) => {
      const value = plot.data[k + 1][idx];
      const shown = value?.toFixed(unitOf(s.signal, s.joint.sliding)[2] + 1) ?? "–";
      const row = h("div", {}, `${reference ? "– –" : this.nameOf(s)}: ${shown} ${unit}`);
      row.style.color = s.colour;
      return row;
    });
    box.replaceChildren(h("div", { class: "t" }, `${time?.toFixed(2)} s`), ...rows);
    box.style.left = plot.cursor.left > plot.over.clientWidth / 2 ? "4px" : "auto";
    box.style.right = plot.cursor.left > plot.over.clientWidth / 2 ? "auto" : "4px";
  }

  draw() {
    if (!this.dirty || document.hidden) return;
    this.dirty = false;
    for (const { signals, plot } of this.charts) {
      const tables = signals.map((s) => {
        const factor = unitOf(s.signal, s.joint.sliding)[0];
        const { times, columns } = this.seen(s);
        return [times, ...columns.map((column) => column.map((v) => (v === null ? null : v * factor)))];
      });
      const data = tables.length === 1 ? tables[0] : window.uPlot.join(tables);
      plot.batch(() => { plot.setData(data, false); plot.setScale("x", { min: -this.window, max: 0 }); });
    }
  }

  /** The visible part of a signal: times before its board's last state, s; its values, and its reference's. */
  seen(s) {
    const now = Math.max(...this.signals.filter((other) => other.board === s.board)
      .map((other) => other.times.at(-1) ?? -Infinity));
    const found = s.times.findIndex((t) => t >= now - this.window);
    const first = found < 0 ? s.times.length : found;
    const columns = s.beside ? [s.values, s.references] : [s.values];
    return { times: s.times.slice(first).map((t) => t - now), columns: columns.map((column) => column.slice(first)) };
  }

  resize() {
    const width = this.body.clientWidth;
    if (width > 100) for (const { plot } of this.charts) plot.setSize({ width, height: HEIGHT });
  }

  savePicture() {
    const canvases = this.charts.map(({ plot }) => plot.ctx.canvas);
    const gap = 22;
    const whole = h("canvas");
    whole.width = Math.max(...canvases.map((c) => c.width));
    whole.height = canvases.reduce((sum, c) => sum + c.height, 0) + gap * this.signals.length + 16;
    const context = whole.getContext("2d");
    context.fillStyle = getComputedStyle(document.documentElement).getPropertyValue("--card");
    context.fillRect(0, 0, whole.width, whole.height);
    let y = 0;
    for (const canvas of canvases) { context.drawImage(canvas, 0, y); y += canvas.height; }
    context.font = "13px system-ui, sans-serif";
    for (const s of this.signals) {
      y += gap;
      context.fillStyle = s.colour;
      context.fillText(`${s.joint.name} ${LABELS[s.signal].toLowerCase()} (${unitOf(s.signal, s.joint.sliding)[1]})`,
        16, y);
    }
    whole.toBlob((picture) => download("plots.png", picture));
  }

  /** The visible part as CSV: rad, rad/s, N·m, %, A, °C; time 0 is a board's last state. */
  saveTable() {
    const names = [];
    const columns = [];
    for (const s of this.signals) {
      const { times, columns: seen } = this.seen(s);
      const of = this.boards.length > 1 ? `${s.board}/` : "";
      [s.signal, s.beside].slice(0, seen.length).forEach((signal, k) => {
        names.push(`${of}${s.joint.name}.${signal}`);
        columns.push(new Map(times.map((t, n) => [t.toFixed(6), seen[k][n]])));
      });
    }
    const times = [...new Set(columns.flatMap((column) => [...column.keys()]))].sort((a, b) => a - b);
    const quoted = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
    const rows = times.map((t) => [t, ...columns.map((c) => c.get(t) ?? "")].join());
    download("plots.csv", [["time", ...names.map(quoted)].join(), ...rows, ""].join("\n"), "text/csv");
  }
}

/** The curves of a chart: each signal, followed by its reference, if any. @param {Plotted[]} signals */
function curves(signals) {
  return signals.flatMap((s) =>
    (s.beside ? [{ s, reference: false }, { s, reference: true }] : [{ s, reference: false }]));
}
