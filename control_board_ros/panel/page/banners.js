// SPDX-License-Identifier: Apache-2.0
// @ts-check
// Banners: faults and their recovery, takeover requests, a lost connection.

import { button, h, setText } from "./dom.js";
import { frameCharts } from "./frame.js";

// The code of an emergency stop.
const STOPPED = 24;

// Next step before a fault is cleared, by its code.
const ADVICE = {
  0: "Release the emergency stop.", 1: "Check the joint for an obstruction or an overload.",
  2: "Let the motor cool: the load exceeded its continuous current.", 8: "Check the torque sensor and its cable.",
  9: "Check the encoder.", 10: "Check the encoder's cable.", 11: "Check the encoder for noise or a loose cable.",
  14: "Encoder and motor disagree: check the coupling.", 15: "The simulation diverged: lower the gains or the load.",
  16: "The joint has no such mode: choose one of its list.", 17: "Move the joint back from its hard stop.",
  19: "Let the winding cool.", 20: "Clear the path to the stop, then calibrate again.",
  21: "Send references more often than the timeout.",
  24: "Release the emergency stop.",
};

const MOST_FAULTS = 4; // that are shown at most

const key = ({ board, fault }) => JSON.stringify([board.name, fault.name, fault.code, fault.text, fault.stamp]);

function ago(seconds) {
  if (!(seconds >= 0)) return "";
  if (seconds < 90) return `${Math.round(seconds)} s ago`;
  return seconds < 5400 ? `${Math.round(seconds / 60)} min ago` : `${(seconds / 3600).toFixed(1)} h ago`;
}

/** Two tones and a shake, where the browser allows them. */
function callAttention() {
  navigator.vibrate?.([200, 100, 200]);
  try {
    const sound = new AudioContext();
    for (const [start, pitch] of [[0, 660], [0.25, 880]]) {
      const tone = new OscillatorNode(sound, { frequency: pitch });
      tone.connect(new GainNode(sound, { gain: 0.15 })).connect(sound.destination);
      tone.start(sound.currentTime + start);
      tone.stop(sound.currentTime + start + 0.2);
    }
    setTimeout(() => sound.close(), 1000);
  } catch (error) {
    console.info(`no sound: ${error.message}`);
  }
}

/** Set the children of an element without replacing those that stay: a finger may be on one. */
function keepChildren(element, children) {
  for (const child of Array.from(element.children)) if (!children.includes(child)) child.remove();
  children.forEach((child, k) => {
    if (element.children[k] !== child) element.insertBefore(child, element.children[k] ?? null);
  });
}

/**
 * The banners. A banner keeps its element while its content is the same: its buttons stay under
 * the finger, its countdown continues, and it signals once.
 */
export class Banners {
  /** @param {HTMLElement} element @param {Panel} panel */
  constructor(element, panel) {
    this.element = element;
    this.panel = panel;
    this.asked = this.ask = null;
    this.ages = new Map();
    this.faults = [];
    this.lost = h("div", { class: "banner warn" }, h("strong", {}, "No connection to the panel's server."),
      " It is tried again every second. What was held has stopped.");
    this.headline = h("div", { class: "headline" });
    this.list = h("ul");
    this.more = h("li");
    this.clear = button("command", "Clear faults: the joints go to idle, without power", () => this.clearFaults());
    this.released = new Set(); // faults of a stop that is released
    this.waits = new Map(); // by joint: when its cause can be gone, ms
    this.release = button("command primary", null, () => this.releaseStop(), "Release stop");
    this.recover = button("command primary", "Recover: the joints go back to the modes before, where they are",
      () => this.recoverAll(), "Recover");
    this.fault = h("div", { class: "banner fault", role: "alert" }, this.headline, this.list, this.release,
      this.recover, this.clear);
  }

  draw() {
    const { model } = this.panel;
    const { asking, holder } = model.operator;
    const asked = model.you !== null && holder === model.you && asking !== null && asking !== undefined;
    if (!asked) this.asked = null;
    else if (this.asked !== asking) this.begin(asking);
    this.drawFaults();
    keepChildren(this.element,
      [model.you === null && this.lost, asked && this.ask, this.faults.length && this.fault].filter(Boolean));
    this.panel.permit(this.element);
    this.tick();
  }

  /** A takeover request, until its answer. */
  begin(asking) {
    const { browsers, seconds } = this.panel.model.operator;
    this.asked = asking;
    this.until = performance.now() + 1000 * seconds;
    this.countdown = h("span");
    const answer = (yes) => () => this.panel.request("hand_over", { yes });
    this.ask = h("div", { class: "banner ask" },
      h("strong", {}, `${browsers[asking] ?? "Another browser"} asks to take over.`), " ", this.countdown,
      h("span", { class: "space" }), button("", null, answer(true), "Hand over"),
      button("primary", null, answer(false), "Keep operating"));
    callAttention();
  }

  drawFaults() {
    const faults = this.panel.model.parts.flatMap((board) => board.faults.map((fault) => ({ board, fault })));
    const ages = new Map(faults.slice(0, MOST_FAULTS)
      .map((entry) => [key(entry), this.ages.get(key(entry)) ?? this.row(entry)]));
    this.faults = faults;
    this.ages = ages;
    setText(this.headline, faults.length === 1 ? "Fault" : `${faults.length} faults`);
    for (const [name, { fault, advice }] of ages) if (fault.code === STOPPED)
      setText(advice, this.released.has(name) ? "Released: recover it." : ADVICE[STOPPED]);
    this.release.hidden = !faults.some((entry) => entry.fault.code === STOPPED && !this.released.has(key(entry)));
    this.recover.classList.toggle("primary", this.release.hidden); // refused before the release
    setText(this.clear, faults.length === 1 ? "Clear fault" : "Clear faults");
    setText(this.more, `and ${faults.length - ages.size} more`);
    keepChildren(this.list, [...[...ages.values()].map(({ row }) => row),
      ...(faults.length > ages.size ? [this.more] : [])]);
  }

  row({ board, fault }) {
    const age = h("span", { class: "age" });
    const joint = board.joint(fault.name);
    const frame = h("div", { hidden: true });
    const name = joint?.short ?? fault.name;
    const around = button("small-button", `${name}: what was around the fault`,
      () => this.showFrame(board, joint, fault, around, frame), "Around it", { "aria-expanded": "false" });
    const advice = h("span", { class: "advice" }, ADVICE[fault.code] ?? "Remove the cause.");
    return { board, fault, age, advice,
      row: h("li", {}, h("strong", {}, name), " ", h("span", { class: "cause" }, fault.text), " ", age,
      advice, " ", around, frame) };
  }

  /** Show or hide the freeze frame of a fault. */
  async showFrame(board, joint, fault, button, frame) {
    if (frame.hidden) {
      const answer = await this.panel.request("frame", { board: board.name, joint: fault.name });
      if (!answer.frame?.time?.length) return;
      frame.replaceChildren(frameCharts(answer.frame, joint?.sliding));
    }
    frame.hidden = !frame.hidden;
    button.setAttribute("aria-expanded", String(!frame.hidden));
  }

  /** Release the emergency stop: every joint stays without power until recovered. */
  async releaseStop() {
    const text = "Release the emergency stop of every board? The joints stay without power until they are recovered.";
    const stopped = this.faults.filter(({ fault }) => fault.code === STOPPED).map(key);
    if (!await this.panel.questions.ask(text, "Release", { safe: true })) return;
    const answer = await this.panel.request("estop", { on: false });
    if (answer.ok) this.released = new Set(stopped);
    this.draw();
  }

  /** Recover the faulted joints of each board, all or none, to their previous modes; some must wait. */
  async recoverAll() {
    for (const board of new Set(this.faults.map((entry) => entry.board))) {
      const joints = this.faults.filter((entry) => entry.board === board).map((entry) => entry.fault.name);
      const answer = await this.panel.request("recover", { board: board.name, joints });
      for (const [name, wait] of Object.entries(answer.waits ?? {})) if (wait > 0)
        this.waits.set(`${board.name} ${name}`, performance.now() + 1000 * wait);
    }
    this.tick();
  }

  clearFaults() {
    for (const board of new Set(this.faults.map((entry) => entry.board))) {
      const joints = this.faults.filter((entry) => entry.board === board).map((entry) => entry.fault.name);
      this.panel.request("mode", { board: board.name, joints, mode: "fidl" });
    }
  }

  tick() {
    for (const { board, fault, age } of this.ages.values()) {
      const left = ((this.waits.get(`${board.name} ${fault.name}`) ?? 0) - performance.now()) / 1000;
      const since = board.stamp ? ago(board.stamp - fault.stamp) : "";
      setText(age, left > 0 ? `${since}, wait ${Math.ceil(left)} s` : since);
    }
    if (this.asked !== null) {
      const seconds = Math.ceil(Math.max(this.until - performance.now(), 0) / 1000);
      setText(this.countdown, `Without an answer control goes there in ${seconds} s.`);
    }
  }
}
