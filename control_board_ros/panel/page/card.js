// SPDX-License-Identifier: Apache-2.0
// @ts-check
// One joint: modes, values, references.

import { Details } from "./details.js";
import { button, chooseOnce, h, icon, segmented, setText } from "./dom.js";
import { INTERACTIONS, MODES, TAKES, whatFalls, whyStill } from "./modes.js";
import { HoldSlider, PositionSlider } from "./sliders.js";
import { LABELS, number, quantity, unitOf } from "./units.js";

const SHORT = { temperature: "Temp." };
const VALUES = ["velocity", "torque", "position_reference", "output", "current", "temperature"];

export class Card {
  /** @param {Joint} joint @param {Panel} panel */
  constructor(joint, panel) {
    this.joint = joint;
    this.panel = panel;
    /** @type {Control[]} */
    this.sliders = [];
    this.shownMode = this.shownModes = this.shownWays = this.scale = null;
    const { short, label, name } = joint;
    this.mode = h("select", { class: "mode command", "aria-label": `Control mode of ${label}` });
    chooseOnce(this.mode, (mode) => this.setMode(mode), () => this.joint.mode);
    this.interaction = h("div",
      { class: "segmented small", role: "radiogroup", "aria-label": `Interaction mode of ${label}` });
    this.more = button("ghost more", `More of ${label}`, () => this.expand(this.body.hidden), icon("chevron"),
      { "aria-expanded": "false" });
    this.position = this.value("position", "big");
    this.values = VALUES.map((signal) => this.value(signal));
    this.bar = h("i");
    this.push = h("span", { class: "push", role: "meter", "aria-label": `External torque of ${label}`,
      "aria-valuemin": "-100", "aria-valuemax": "100" }, this.bar);
    this.values.find((v) => v.signal === "torque").element.append(this.push);
    this.slots = h("div", { class: "slots" });
    this.why = h("p", { class: "why" });
    this.foot = h("div", { class: "foot" }, this.why);
    this.body = h("div", { class: "details", hidden: true });
    this.element = h("article", { class: "card", "aria-label": `Joint ${name}` },
      h("header", {}, h("h3", { title: name, onclick: () => { if (this.folded) this.expand(true); } }, short),
        h("div", { class: "modes" }, this.mode, this.interaction), this.more),
      h("div", { class: "readout" }, this.position.element,
        h("div", { class: "values" }, ...this.values.map((v) => v.element))),
      this.slots, this.foot, this.body);
    this.refresh();
  }

  value(signal, kind = "") {
    const shown = h("span", { class: "n" });
    const unit = h("span", { class: "u" });
    const plot = () => (this.folded ? this.expand(true) : this.panel.plot(this.joint, signal));
    const element = h("button",
      { type: "button", class: `value ${kind} ${signal}`, title: `${LABELS[signal]}: plot it`, "aria-pressed": "false",
      "aria-label": `Plot ${LABELS[signal].toLowerCase()} of ${this.joint.label}`, onclick: plot },
    h("span", { class: "l" }, kind ? "" : SHORT[signal] ?? LABELS[signal]), h("span", { class: "nu" }, shown, unit),
      icon("plot"));
    return { signal, element, shown, unit };
  }

  /** A line of a phone's list: a tap opens it. */
  get folded() { return this.panel.layout.view === "list" && this.body.hidden; }

  get where() { return { board: this.joint.board.name, joints: [this.joint.name] }; }

  async setMode(mode) {
    const { joint, panel } = this;
    const falls = whatFalls(joint, mode);
    if (!falls || await panel.questions.ask(`${joint.short} to ${MODES[mode] ?? mode}? ${falls}`, "Set")) {
      await panel.request("mode", { ...this.where, mode });
    }
    this.mode.value = this.joint.mode; // also where it was refused
    this.refresh();
  }

  /** Whether a position may be sent: a long way requires confirmation, with the ghost at its end. */
  async mayGo(value, kind) {
    const { joint, panel } = this;
    const from = joint.state?.position ?? value;
    const most = joint.sliding ? panel.askAbove / 300 : panel.askAbove * Math.PI / 180;
    if (panel.live || Math.abs(value - from) <= most + 1e-9) return true;
    const words = (q) => quantity(q, "position", joint.sliding);
    const { drops } = panel;
    const text = `${joint.short} from ${words(from)} to ${words(value)}, ${await this.lasting(value - from, kind)}?`;
    return drops === panel.drops && panel.questions.ask(text, "Go", { safe: true });
  }

  /** The duration of a way at the set speed, in words. */
  async lasting(way, kind) {
    const { joint } = this;
    const { velocity, acceleration } = joint.limits;
    if (kind === "direct") return `as a step: at up to ${quantity(velocity, "velocity", joint.sliding)}`;
    if (joint.speed === null) {
      const answer = await this.panel.ask("details", { board: joint.board.name, joint: joint.name });
      if (answer.ok) joint.speed = answer.details.speed;
    }
    const length = Math.abs(way);
    const time = Math.max(length / joint.speed, 1.875 * length / (velocity ?? Infinity),
      Math.sqrt(5.774 * length / (acceleration ?? Infinity)));
    return Number.isFinite(time) ? `${time.toFixed(1)} s` : "at its set speed";
  }

  /** Update after a change of modes, limits, units or operator. */
  refresh() {
    const { joint } = this;
    this.element.dataset.mode = joint.mode;
    const modes = [joint.mode, joint.modes].join("|");
    const ways = [joint.interaction, joint.interactions].join("|");
    const scale = [joint.limits.lower, joint.limits.upper, joint.limits.velocity, joint.kind].join("|");
    if (modes !== this.shownModes) this.drawModes();
    if (ways !== this.shownWays) this.drawInteraction(); // else a press on it would be lost
    if (joint.mode !== this.shownMode) this.drawSliders();
    else if (scale !== this.scale) for (const slider of this.sliders) slider.layout(); // keeps what is typed
    this.shownModes = modes;
    this.shownWays = ways;
    this.shownMode = joint.mode;
    this.scale = scale;
    this.panel.permit(this.element);
    this.details?.permit();
  }

  drawModes() {
    const { joint } = this;
    const codes = joint.modes.includes(joint.mode) ? joint.modes : [joint.mode, ...joint.modes];
    this.mode.replaceChildren(...codes.filter(Boolean)
      .map((code) => h("option", { value: code, selected: code === joint.mode }, MODES[code] ?? code)));
    if (joint.mode === "hwfa") this.mode.append(h("option", { value: "fidl" }, "Clear the fault (idle)"));
    if (joint.mode === "cal") this.mode.append(h("option", { value: "fidl" }, "Abort (idle)"));
    this.mode.value = joint.mode;
  }

  drawInteraction() {
    const { joint } = this;
    this.interaction.hidden = joint.interactions.length < 2;
    segmented(this.interaction, `Interaction of ${joint.label}`,
      Object.fromEntries(joint.interactions.map((code) => [code, INTERACTIONS[code] ?? code])), joint.interaction,
      (code) => this.panel.request("interaction", { ...this.where, mode: code }));
    for (const button of this.interaction.children) button.classList.add("command");
  }

  drawSliders() {
    for (const slider of this.sliders) slider.close?.();
    this.sliders = (TAKES[this.joint.mode] ?? []).map((kind) => this.slider(kind));
    if (!this.sliders.length) {
      const shown = new PositionSlider(this.joint, { send: () => {}, isLive: () => false, ask: () => false });
      shown.element.classList.add("still");
      shown.input.tabIndex = -1;
      for (const input of [shown.input, shown.box]) { input.disabled = true; input.classList.remove("command"); }
      this.sliders = [shown];
    }
    this.slots.replaceChildren(...this.sliders.map((slider) => slider.element));
    const still = this.sliders.some((slider) => slider.element.classList.contains("still"));
    this.foot.replaceChildren(this.why, ...this.sliders.map((slider) => !still && slider.steps).filter(Boolean));
  }

  slider(kind) {
    const { joint, panel } = this;
    if (kind === "position" || kind === "direct") {
      return new PositionSlider(joint, {
        isLive: () => panel.live,
        ask: (value) => this.mayGo(value, kind),
        send: (value, live) => panel.request(kind, { ...this.where, positions: [value], live }),
      });
    }
    const where = { board: joint.board.name, joint: joint.name, kind };
    return new HoldSlider(joint, kind, {
      hold: (value) => panel.hold({ ...where, value }),
      release: () => panel.release(where),
    });
  }

  /** Show or hide the details. */
  expand(open) {
    if (open !== this.body.hidden) return;
    this.body.hidden = !open;
    this.element.classList.toggle("open", open);
    this.more.setAttribute("aria-expanded", String(open));
    if (open) {
      this.details = new Details(this.joint, this.panel);
      this.body.replaceChildren(this.details.element);
      this.panel.layout.opened(this);
    } else {
      this.details = null;
      this.body.replaceChildren();
    }
  }

  /** Update the marks: with every frame. */
  draw() { for (const slider of this.sliders) slider.draw(); }

  /** Update the numbers: a few times a second. */
  write() {
    const { joint } = this;
    for (const { signal, element, shown, unit } of [this.position, ...this.values]) {
      const value = joint.state?.[signal];
      const none = signal === "temperature" && !Number.isFinite(value);
      if (element.hidden !== none) element.hidden = none;
      setText(shown, number(value, signal, joint.sliding));
      setText(unit, unitOf(signal, joint.sliding)[1]);
      const plotted = String(Boolean(this.panel.plots.find(joint, signal)));
      if (element.ariaPressed !== plotted) element.ariaPressed = plotted;
    }
    this.writePush();
    this.details?.write();
    const held = this.sliders.some((slider) => slider.timer);
    const silent = joint.board.silence > 0;
    setText(this.why, silent ? whyStill(joint) : held ? "" : joint.fault ? joint.fault.text : whyStill(joint));
    this.why.classList.toggle("fault", Boolean(joint.fault) || silent);
    if (silent !== this.silent) {
      this.silent = silent;
      this.element.classList.toggle("silent", silent);
      if (silent) this.drop();
      this.panel.permit(this.element);
    }
  }

  /** The bar of the torque from outside: to the right where it is positive. */
  writePush() {
    const { joint } = this;
    const share = joint.externalShare;
    this.push.hidden = share === null;
    if (share === null) return;
    const percent = Math.round(100 * share);
    if (percent === this.pushed) return;
    this.pushed = percent;
    this.push.setAttribute("aria-valuenow", String(percent));
    const torque = quantity(joint.state.external_torque, "external_torque", joint.sliding);
    this.push.title = `External torque: ${torque}; full at a quarter of the limit`;
    this.bar.style.cssText = `left:${50 + Math.min(percent, 0) / 2}%;width:${Math.abs(percent) / 2}%`;
  }

  /** Cancel inputs in progress. */
  drop() { for (const slider of this.sliders) slider.drop(); }

  close() { for (const slider of this.sliders) slider.close?.(); }
}
