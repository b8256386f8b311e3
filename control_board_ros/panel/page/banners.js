// SPDX-License-Identifier: Apache-2.0
// What must be seen: faults with their way out, who asks to take over, a lost connection.

import { h, setText } from "./dom.js";

// What to do before a fault is cleared, by its code.
const ADVICE = {
  0: "Release the emergency stop.", 1: "Look for what blocks the joint or overloads its motor.",
  2: "Let the motor cool: it worked above its continuous current.", 8: "Check the torque sensor and its cable.",
  9: "Check the encoder.", 10: "Check the encoder's cable.", 11: "Check the encoder for noise or a loose cable.",
  14: "Encoder and motor disagree: check the coupling.", 15: "The simulation diverged: lower the gains or the load.",
  16: "The joint has no such mode: choose one of its list.", 17: "Bring the joint back from its stop.",
  19: "Let the winding cool.", 20: "Free the way to the stop, then calibrate again.", 21: "Send references more often than the timeout.",
};

function ago(seconds) {
  if (!(seconds >= 0)) return "";
  if (seconds < 90) return `${Math.round(seconds)} s ago`;
  return seconds < 5400 ? `${Math.round(seconds / 60)} min ago` : `${(seconds / 3600).toFixed(1)} h ago`;
}

export class Banners {
  constructor(element, panel) { Object.assign(this, { element, panel, ages: [], since: 0 }); }

  draw() {
    const { model } = this.panel;
    const { asking, holder, browsers, seconds } = model.operator;
    const faults = model.parts.flatMap((board) => board.faults.map((fault) => ({ board, fault })));
    const key = JSON.stringify([faults.map(({ board, fault }) => [board.name, fault.name, fault.text]), asking, holder, model.you, model.mayOperate]);
    if (key === this.shown) return;
    this.shown = key;
    this.ages = [];
    const rows = [];
    if (model.you === null) rows.push(h("div", { class: "banner warn" }, h("strong", {}, "No connection to the panel's server."), " It is tried again every second. What was held has stopped."));
    if (asking !== null && holder === model.you && asking !== undefined && model.you !== null) {
      this.since = performance.now();
      this.countdown = h("span");
      this.answerTime = seconds;
      const answer = (yes) => () => this.panel.request("hand_over", { yes });
      rows.push(h("div", { class: "banner ask" }, h("strong", {}, `${browsers[asking] ?? "Somebody"} asks to take over.`), " ", this.countdown,
        h("span", { class: "space" }), h("button", { type: "button", onclick: answer(true) }, "Hand over"), h("button", { type: "button", class: "primary", onclick: answer(false) }, "Keep operating")));
    } else this.countdown = null;
    if (faults.length) rows.push(this.faults(faults));
    this.element.replaceChildren(...rows);
    this.panel.permit(this.element);
    this.tick();
  }

  faults(faults) {
    const shown = faults.slice(0, 4).map(({ board, fault }) => {
      const age = h("span", { class: "age" });
      this.ages.push({ board, fault, age });
      const joint = board.joint(fault.name);
      return h("li", {}, h("strong", {}, joint?.short ?? fault.name), " ", h("span", { class: "cause" }, fault.text), " ", age,
        h("span", { class: "advice" }, ADVICE[fault.code] ?? "Remove the cause."));
    });
    const clear = () => {
      for (const board of new Set(faults.map((entry) => entry.board))) {
        const joints = faults.filter((entry) => entry.board === board).map((entry) => entry.fault.name);
        this.panel.request("mode", { board: board.name, joints, mode: "fidl" });
      }
    };
    const more = faults.length > shown.length ? h("li", {}, `and ${faults.length - shown.length} more`) : null;
    return h("div", { class: "banner fault", role: "alert" }, h("div", { class: "headline" }, faults.length === 1 ? "Fault" : `${faults.length} faults`),
      h("ul", {}, ...shown, more), h("button", { type: "button", class: "command primary", onclick: clear, "aria-label": "Clear faults: the joints go to idle, without power" }, faults.length === 1 ? "Clear fault" : "Clear faults"));
  }

  tick() {
    for (const { board, fault, age } of this.ages) setText(age, board.stamp ? ago(board.stamp - fault.stamp) : "");
    if (this.countdown) {
      const left = Math.max(this.answerTime - (performance.now() - this.since) / 1000, 0);
      setText(this.countdown, `Without an answer it happens in ${Math.ceil(left)} s.`);
    }
  }
}
