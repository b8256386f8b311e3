// SPDX-License-Identifier: Apache-2.0
// @ts-check
// The page: tabs of boards, cards of joints, and shared controls.

import { Banners } from "./banners.js";
import { Card } from "./card.js";
import { Connection } from "./connection.js";
import { button, chooseOnce, h, redraw, segmented, toast } from "./dom.js";
import { Layout } from "./layout.js";
import { Log } from "./log.js";
import { Model } from "./model.js";
import { MODES, whatFalls } from "./modes.js";
import { Operator } from "./operator.js";
import { Plots } from "./plots.js";
import { Poses } from "./poses.js";
import { Recording } from "./recording.js";
import { Questions } from "./questions.js";
import { followTheme } from "./theme.js";
import { inDegrees, setDegrees } from "./units.js";

const ALL = "all joints";
const WRITE_EVERY = 66; // ms between changes of numbers
const STOP_ANSWER = 1000; // ms within which a STOP is confirmed, or said not to be
const VIEW_AFTER = 2000; // ms until the view in 3D is loaded, where no state comes before
const ASK_ABOVE = 15; // degrees above which a way asks for confirmation

const $ = (id) => document.getElementById(id);
const connection = new Connection();
const model = new Model(connection);

export class Panel {
  constructor() {
    this.live = false;
    this.drops = 0; // how often everything was dropped
    this.tab = null;
    /** @type {Card[]} */
    this.cards = [];
    this.written = this.framed = 0;
    this.model = model;
    this.log = new Log($("log"), this);
    this.plots = new Plots($("plots"), this);
    this.recording = new Recording($("recording"), this);
    this.poses = new Poses($("poses"), this);
    this.banners = new Banners($("banners"), this);
    this.questions = new Questions($("questions"), this);
    this.askAbove = Number(localStorage.getItem("ask above") ?? ASK_ABOVE);
    this.operator = new Operator($("operator"), this);
    this.layout = new Layout(this, $("cards"));
    this.drawUnits();
    followTheme($("theme"), () => { this.plots.rebuild(); this.view?.recolour(); });
    this.drawToolbar();
    $("stop").addEventListener("click", () => this.stop());
    $("estop").addEventListener("click", () => this.emergencyStop());
    document.addEventListener("keydown", (event) => {
      if (event.key === "Escape") { event.preventDefault(); this.stop(); }
    });
    connection.on("open", () => { this.watched = null; this.watch(); this.poses.refresh(); });
    connection.on("log", (entry) => {
      this.log.add(entry);
      if (entry.what.includes("save_pose")) this.poses.refresh(); // whoever saved it
    });
    connection.on("history", ({ entries }) => this.log.begin(entries));
    connection.on("recordings", (state) => this.recording.tell(state));
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
    model.on("operator", () => {
      if (!model.mayOperate) { this.setLive(false); this.drop(); }
      this.refresh();
    });
    model.on("move", (board) => this.askTargets(board));
    model.on("state", (board) => this.plots.take(board));
    requestAnimationFrame(() => this.frame());
    this.opening = setTimeout(() => this.openView(), VIEW_AFTER);
  }

  // Requests

  ask(what, fields, progress) { return connection.ask(what, fields, progress); }

  /** A request; a refusal is always shown. */
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

  /** STOP every joint of every board; voids inputs in progress. Success is the boards' answer. */
  stop() {
    this.poses.end();
    this.drop();
    $("stop").classList.add("pressed");
    setTimeout(() => $("stop").classList.remove("pressed"), 250);
    if (!connection.open) { toast("STOP NOT SENT: no connection to the panel's server", true, true); return; }
    let lives = false; // the server answers: then a board does not
    connection.ask("watch", { boards: (this.watched ?? "").split(",").filter(Boolean) }).then(() => { lives = true; });
    const late = setTimeout(() =>
      toast(`STOP NOT CONFIRMED: ${lives ? this.notAnswering() : "the panel's server does not answer"}`, true, true),
      STOP_ANSWER);
    connection.ask("stop").then((answer) => {
      clearTimeout(late);
      if (answer.ok) toast("Stopped: every joint of every board.");
      else toast(`STOP FAILED: ${answer.message}`, true, true);
    });
  }

  /** Who does not answer while the panel's server does. */
  notAnswering() {
    const silent = model.parts.filter((board) => board.silence);
    if (!silent.length) return "the panel's server lives, a board has not answered yet";
    const names = silent.map((board) => model.titleOf(board)).join(", ");
    const seconds = Math.max(...silent.map((board) => board.silence)).toFixed(1);
    const verb = silent.length > 1 ? "do" : "does";
    return `${names} ${verb} not answer: no state for ${seconds} s. Cut its power if it moves.`;
  }

  /** Disable every joint of every board at once, without confirmation. */
  emergencyStop() {
    this.poses.end();
    this.drop();
    if (!connection.open) { toast("EMERGENCY STOP NOT SENT: no connection to the panel's server", true, true); return; }
    connection.ask("estop", { on: true }).then((answer) => {
      if (answer.ok) toast(answer.message || "Emergency stop: every joint of every board is without power.");
      else toast(`EMERGENCY STOP FAILED: ${answer.message}`, true, true);
    });
  }

  /** Void positions being chosen, release held controls, answer questions with no. */
  drop() {
    this.drops += 1;
    this.questions.end(false);
    for (const card of this.cards) card.drop();
  }

  /** The target of a move that has started, of any program. @param {Board} board */
  askTargets(board) {
    connection.ask("targets", { board: board.name })
      .then((answer) => { if (answer.ok) model.setTargets(board, answer.targets); });
  }

  /** Enable controls that command for the operator of an answering board. */
  permit(element) {
    const dead = !model.mayOperate || element.closest(".silent") !== null;
    for (const control of element.querySelectorAll(".command")) {
      control.disabled = dead || control.dataset.idle === "true";
    }
  }

  plot(joint, signal) { this.plots.toggle(joint, signal); }

  // Drawing

  get boards() { return model.parts; }

  shownBoards() {
    if (this.tab === ALL) return model.inOrder(this.boards);
    return [...model.boards.values()].filter((board) => board.name === this.tab);
  }

  watch() {
    const plotted = this.plots.boards.filter((board) => !this.shownBoards().includes(board));
    const names = model.sources([...this.shownBoards(), ...plotted]).map((board) => board.name).sort();
    if (names.join() === this.watched) return;
    this.watched = names.join();
    connection.ask("watch", { boards: names });
  }

  drawTabs() {
    const names = model.inOrder(model.parts).map((board) => board.name);
    const tabs = names.length > 1 ? [ALL, ...names] : names;
    if (!tabs.includes(this.tab)) this.tab = names.length > 1 ? ALL : names[0] ?? null;
    const choose = (name) => { this.tab = name; this.setLive(false); this.drawTabs(); };
    redraw($("tabs"), "[aria-selected=true]", tabs.map((name) => button(
      "", null, () => choose(name), name === ALL ? "All joints" : model.titleOf(model.boards.get(name)),
      { role: "tab", "aria-selected": String(name === this.tab), "data-name": name })));
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
    const all = this.shownBoards().flatMap((board) => board.joints);
    for (const joint of all) { // for screen readers: both arms have an elbow
      const twice = all.some((other) => other !== joint && other.short === joint.short);
      joint.label = twice ? `${model.titleOf(joint.board)} ${joint.short}` : joint.short;
    }
    this.cards = [];
    const parts = this.shownBoards().map((board) => {
      const cards = board.joints.map((joint) => new Card(joint, this));
      this.cards.push(...cards);
      return [several ? h("h2", { class: "part" }, model.titleOf(board)) : null, ...cards.map((card) => card.element)];
    });
    $("cards").replaceChildren(...parts.flat().filter(Boolean));
    this.layout.draw();
    const empty = $("empty");
    empty.hidden = this.cards.length > 0;
    empty.replaceChildren(h("h2", {}, "No board on this ROS domain"),
      h("p", {}, "The panel looks for boards all the time. Start one with ", h("code", {}, "control_board"),
        ", with the same ROS_DOMAIN_ID."));
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
    this.recording.permit();
    this.banners.draw();
    this.operator.draw();
    $("stop").classList.toggle("dead", model.you === null);
    /** @type {Text} */ ($("stop").firstChild).data = model.you === null ? "NO STOP: not connected" : "STOP";
  }

  drawToolbar() {
    this.allModes = h("select", { class: "command", "aria-label": "Control mode of all joints shown" });
    chooseOnce(this.allModes, (mode) => this.setAll(mode), () => "");
    this.liveSwitch = button("switch command", "Live: send while a slider moves", () => this.setLive(!this.live),
      "Live", { role: "switch", "aria-checked": "false",
        title: "Send while a slider moves, not only when it is let go; long ways are not asked about" });
    this.liveSwitch.prepend(h("span", { class: "knob" }));
    this.idle = button("command", "All joints shown to idle: no power", () => this.setAll("idl"), "Idle all");
    this.calibrateAll = button("command", "Calibrate all joints shown", () => this.each("calibrate", {}),
      "Calibrate all");
    this.rate = h("span", { class: "rate", title: "States shown per second" });
    const above = h("input", { class: "number", type: "number", min: "0", max: "360", step: "5",
      "aria-label": "Ask before ways longer than this, degrees",
      onchange: () => { this.askAbove = Math.max(Number(above.value) || 0, 0);
        localStorage.setItem("ask above", String(this.askAbove)); } });
    above.value = String(this.askAbove);
    $("toolbar").append(this.layout.choice, h("label", { class: "all" }, "All to", this.allModes), this.idle,
      this.calibrateAll, h("span", { class: "space" }), this.rate,
      h("label", { class: "all",
        title: "A tap or a typed number that leads further asks first; 50 mm where a joint slides at 15°" },
        "Ask above", above, "°"), this.liveSwitch);
  }

  drawAllModes() {
    const common = this.cards.map((card) => card.joint.modes)
      .reduce((a, b) => a.filter((code) => b.includes(code)), this.cards[0]?.joint.modes ?? []);
    const key = common.join();
    if (key === this.offered) return;
    this.offered = key;
    this.allModes.replaceChildren(h("option", { value: "" }, "mode …"),
      ...common.map((code) => h("option", { value: code }, MODES[code] ?? code)));
  }

  async setAll(mode) {
    this.allModes.value = "";
    if (!mode) return;
    const falls = this.cards.map(({ joint }) => [joint.short, whatFalls(joint, mode)]).filter(([, why]) => why);
    const words = falls.slice(0, 3).map(([short, why]) => `${short}: ${why}`).join(" ")
      + (falls.length > 3 ? ` And ${falls.length - 3} more.` : "");
    if (falls.length && !await this.questions.ask(`All joints shown to ${MODES[mode] ?? mode}? ${words}`, "Set all"))
      return;
    this.each("mode", { mode });
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

  /** Load the 3D view after the first state is shown. */
  begun() {
    this.seen = performance.mark("first state shown");
    this.openView();
  }

  async openView() {
    clearTimeout(this.opening);
    if (this.viewed) return;
    this.viewed = true;
    try {
      const { View } = await import("./view.js");
      this.view = new View($("view"), this);
      this.view.load(this.shownBoards());
    } catch (error) {
      $("view").replaceChildren(h("p", { class: "hint" }, `No 3D view: ${error.message}`));
    }
  }

  frame() {
    requestAnimationFrame(() => this.frame()); // first: what one board does wrong ends no drawing
    const now = performance.now();
    model.pass(now - this.framed);
    this.framed = now;
    for (const card of this.cards) card.draw();
    if (now - this.written >= WRITE_EVERY) {
      this.written = now;
      for (const card of this.cards) card.write();
      if (!this.seen && this.cards.some((card) => card.joint.state)) this.begun();
      this.banners.tick();
      this.recording.tick();
      this.plots.draw();
    }
    try { this.view?.draw(this.shownBoards()); } catch (error) { this.view.fail(error); }
  }
}

window.panel = new Panel();
if (new URLSearchParams(location.search).has("token")) history.replaceState(null, "", location.pathname);
