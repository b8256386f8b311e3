// SPDX-License-Identifier: Apache-2.0
// The page: tabs of boards, cards of joints, and what is shared by all of them.

import { Banners } from "./banners.js";
import { Card } from "./card.js";
import { Connection } from "./connection.js";
import { h, icon, redraw, segmented, toast } from "./dom.js";
import { Log } from "./log.js";
import { Model } from "./model.js";
import { MODES } from "./modes.js";
import { Operator } from "./operator.js";
import { Plots } from "./plots.js";
import { Poses } from "./poses.js";
import { inDegrees, setDegrees } from "./units.js";

const ALL = "all joints";
const WRITE_EVERY = 66; // ms between changes of numbers

const $ = (id) => document.getElementById(id);
const connection = new Connection();
const model = new Model(connection);

class Panel {
  constructor() {
    this.live = false;
    this.tab = null;
    this.cards = [];
    this.written = 0;
    this.model = model;
    this.log = new Log($("log"), this);
    this.plots = new Plots($("plots"), this);
    this.poses = new Poses($("poses"), this);
    this.banners = new Banners($("banners"), this);
    this.operator = new Operator($("operator"), this);
    this.drawUnits();
    this.drawTheme();
    this.drawToolbar();
    $("stop").addEventListener("click", () => this.stop());
    document.addEventListener("keydown", (event) => {
      if (event.key === "Escape") { event.preventDefault(); this.stop(); }
    });
    connection.on("open", () => { this.watched = null; this.watch(); });
    connection.on("log", (entry) => this.log.add(entry));
    connection.on("notice", ({ message }) => toast(message));
    connection.on("error", ({ message }) => toast(message, true));
    model.on("boards", () => this.drawTabs());
    model.on("info", () => {
      this.refresh();
      this.view?.load(this.shownBoards());
      if (!this.poses.offered) this.poses.load();
    });
    model.on("modes", () => this.refresh());
    model.on("faults", () => this.refresh());
    model.on("operator", () => { if (!model.mayOperate) this.setLive(false); this.refresh(); });
    model.on("state", (board) => this.plots.take(board));
    requestAnimationFrame(() => this.frame());
    this.openView();
  }

  // Asking

  ask(what, fields, progress) { return connection.ask(what, fields, progress); }

  /** A request whose refusal everybody should read. */
  request(what, fields, progress) {
    const asked = connection.ask(what, fields, progress);
    return Object.assign(asked.then((answer) => {
      if (!answer.ok) toast(answer.message || "refused", true);
      else if (answer.message) toast(answer.message);
      return answer;
    }), { id: asked.id });
  }

  hold(fields) {
    connection.ask("hold", fields).then((answer) => { if (!answer.ok) toast(answer.message, true); });
  }

  release(fields) { connection.ask("release", fields); }

  stop() {
    this.poses.end();
    connection.ask("stop").then((answer) => toast(answer.ok ? "Stopped: every joint of every board." : answer.message, !answer.ok));
    $("stop").classList.add("pressed");
    setTimeout(() => $("stop").classList.remove("pressed"), 250);
  }

  /** Controls that command are for the operator; the others see them, and cannot use them. */
  permit(element) {
    for (const control of element.querySelectorAll(".command")) {
      control.disabled = !model.mayOperate || control.dataset.idle === "true";
    }
  }

  plot(joint, signal) { this.plots.toggle(joint, signal); }

  // Drawing

  get boards() { return model.parts; }

  shownBoards() {
    if (this.tab === ALL) return this.boards;
    return [...model.boards.values()].filter((board) => board.name === this.tab);
  }

  watch() {
    const names = model.sources(this.shownBoards()).map((board) => board.name).sort();
    if (names.join() === this.watched) return;
    this.watched = names.join();
    connection.ask("watch", { boards: names });
  }

  drawTabs() {
    const names = [...model.boards.keys()];
    const tabs = names.length > 1 ? [ALL, ...names] : names;
    const spaces = new Set(names.map((name) => name.slice(0, name.lastIndexOf("/") + 1)));
    const title = (name) => (names.length > 1 && spaces.size === 1 ? name.slice(name.lastIndexOf("/") + 1) : model.boards.get(name).title);
    if (!tabs.includes(this.tab)) this.tab = names.length > 1 ? ALL : names[0] ?? null;
    const choose = (name) => { this.tab = name; this.setLive(false); this.drawTabs(); };
    redraw($("tabs"), "[aria-selected=true]", tabs.map((name) => h("button", {
      type: "button", role: "tab", "aria-selected": String(name === this.tab), "data-name": name, onclick: () => choose(name),
    }, name === ALL ? "All joints" : title(name))));
    $("tabs").onkeydown = (event) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (step) choose(tabs[(tabs.indexOf(this.tab) + step + tabs.length) % tabs.length]);
    };
    this.drawCards();
    this.watch();
  }

  drawCards() {
    for (const card of this.cards) card.close();
    const several = this.shownBoards().length > 1;
    this.cards = [];
    const parts = this.shownBoards().map((board) => {
      const cards = board.joints.map((joint) => new Card(joint, this));
      this.cards.push(...cards);
      return [several ? h("h2", { class: "part" }, board.title) : null, ...cards.map((card) => card.element)];
    });
    $("cards").replaceChildren(...parts.flat().filter(Boolean));
    const empty = $("empty");
    empty.hidden = this.cards.length > 0;
    empty.replaceChildren(h("h2", {}, "No board on this ROS domain"),
      h("p", {}, "The panel looks for boards all the time. Start one with ", h("code", {}, "control_board"), ", with the same ROS_DOMAIN_ID."));
    $("toolbar").hidden = this.cards.length === 0;
    this.refresh();
    this.view?.load(this.shownBoards());
    this.poses.load();
  }

  refresh() {
    for (const card of this.cards) card.refresh();
    this.drawAllModes();
    this.permit($("toolbar"));
    this.poses.permit();
    this.banners.draw();
    this.operator.draw();
    $("stop").disabled = model.readOnly;
  }

  drawToolbar() {
    this.allModes = h("select", { class: "command", "aria-label": "Control mode of all joints shown", onchange: () => this.setAll() });
    this.liveSwitch = h("button", { type: "button", role: "switch", class: "switch command", "aria-checked": "false", "aria-label": "Live: send while a slider moves", title: "Send while a slider moves, not only when it is let go", onclick: () => this.setLive(!this.live) }, h("span", { class: "knob" }), "Live");
    this.idle = h("button", { type: "button", class: "command", "aria-label": "All joints shown to idle: no power", onclick: () => this.each("mode", { mode: "idl" }) }, "Idle all");
    this.calibrateAll = h("button", { type: "button", class: "command", "aria-label": "Calibrate all joints shown", onclick: () => this.each("calibrate", {}) }, "Calibrate all");
    this.rate = h("span", { class: "rate", title: "States shown per second" });
    $("toolbar").append(h("label", { class: "all" }, "All to", this.allModes), this.idle, this.calibrateAll, h("span", { class: "space" }), this.rate, this.liveSwitch);
  }

  drawAllModes() {
    const common = this.cards.map((card) => card.joint.modes).reduce((a, b) => a.filter((code) => b.includes(code)), this.cards[0]?.joint.modes ?? []);
    const key = common.join();
    if (key === this.allModes.key) return;
    this.allModes.key = key;
    this.allModes.replaceChildren(h("option", { value: "" }, "mode …"), ...common.map((code) => h("option", { value: code }, MODES[code] ?? code)));
  }

  setAll() {
    const mode = this.allModes.value;
    this.allModes.value = "";
    if (mode) this.each("mode", { mode });
  }

  each(what, fields) {
    for (const board of this.shownBoards()) this.request(what, { board: board.name, joints: [], ...fields });
  }

  setLive(live) {
    this.live = live;
    this.liveSwitch.setAttribute("aria-checked", String(live));
    document.body.classList.toggle("live", live);
  }

  drawUnits() {
    segmented($("units"), "Angles in", { deg: "deg", rad: "rad" }, inDegrees() ? "deg" : "rad", (unit) => {
      setDegrees(unit === "deg");
      this.drawUnits();
      this.drawCards();
      this.plots.rebuild();
    });
  }

  drawTheme() {
    const wanted = localStorage.getItem("theme");
    const dark = wanted ? wanted === "dark" : !matchMedia("(prefers-color-scheme: light)").matches;
    document.documentElement.dataset.theme = dark ? "dark" : "light";
    $("theme").replaceChildren(icon(dark ? "sun" : "moon"));
    $("theme").setAttribute("aria-label", dark ? "Light colours" : "Dark colours");
    $("theme").onclick = () => {
      localStorage.setItem("theme", dark ? "light" : "dark");
      this.drawTheme();
      this.plots.rebuild();
      this.view?.recolour();
    };
  }

  async openView() {
    try {
      const { View } = await import("./view.js");
      this.view = new View($("view"), this);
      this.view.load(this.shownBoards());
    } catch (error) {
      $("view").replaceChildren(h("p", { class: "hint" }, `No 3D view: ${error.message}`));
    }
  }

  frame() {
    const now = performance.now();
    for (const card of this.cards) card.draw();
    if (now - this.written >= WRITE_EVERY) {
      this.written = now;
      for (const card of this.cards) card.write();
      this.banners.tick();
      this.plots.draw();
      const [board] = this.shownBoards();
      const stale = board && board.heard && now - board.heard > 1000;
      document.body.classList.toggle("stale", Boolean(stale));
    }
    this.view?.draw(this.shownBoards());
    requestAnimationFrame(() => this.frame());
  }
}

window.panel = new Panel();
if (new URLSearchParams(location.search).has("token")) history.replaceState(null, "", location.pathname);
