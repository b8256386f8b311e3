// SPDX-License-Identifier: Apache-2.0
// One joint: modes, values, references.

import { Details } from "./details.js";
import { h, icon, segmented, setText } from "./dom.js";
import { INTERACTIONS, MODES, TAKES, whyStill } from "./modes.js";
import { HoldSlider, PositionSlider } from "./sliders.js";
import { LABELS, number, unitOf } from "./units.js";

const VALUES = ["velocity", "torque", "position_reference", "output", "current", "temperature"];

export class Card {
  constructor(joint, panel) {
    Object.assign(this, { joint, panel, sliders: [], shownMode: null });
    const { short, name } = joint;
    this.mode = h("select", { class: "mode command", "aria-label": `Control mode of ${short}`, onchange: () => this.setMode() });
    this.interaction = h("div", { class: "segmented small", role: "radiogroup", "aria-label": `Interaction mode of ${short}` });
    this.more = h("button", { type: "button", class: "ghost more", "aria-expanded": "false", "aria-label": `More of ${short}`, onclick: () => this.expand() }, icon("chevron"));
    this.position = this.value("position", "big");
    this.values = VALUES.map((signal) => this.value(signal));
    this.slots = h("div", { class: "slots" });
    this.why = h("p", { class: "why" });
    this.body = h("div", { class: "details", hidden: true });
    this.element = h("article", { class: "card", "aria-label": `Joint ${name}` },
      h("header", {}, h("h3", { title: name }, short), this.mode, this.interaction, this.more),
      h("div", { class: "readout" }, this.position.element, h("div", { class: "values" }, ...this.values.map((v) => v.element))),
      this.slots, this.why, this.body);
    this.refresh();
  }

  value(signal, kind = "") {
    const shown = h("span", { class: "n" });
    const unit = h("span", { class: "u" });
    const plot = () => this.panel.plot(this.joint, signal);
    const element = h("button", { type: "button", class: `value ${kind}`, title: `${LABELS[signal]}: double-click or Enter plots it`,
      "aria-label": `Plot ${LABELS[signal].toLowerCase()} of ${this.joint.short}`, ondblclick: plot,
      onkeydown: (event) => { if (event.key === "Enter") plot(); } },
    h("span", { class: "l" }, kind ? "" : LABELS[signal]), h("span", { class: "nu" }, shown, unit));
    return { signal, element, shown, unit };
  }

  get where() { return { board: this.joint.board.name, joints: [this.joint.name] }; }

  setMode() {
    const mode = this.mode.value;
    this.shownMode = null;
    this.panel.request("mode", { ...this.where, mode }).then(() => this.refresh());
  }

  /** After a change of modes, limits, units or of the operator. */
  refresh() {
    const { joint } = this;
    this.element.dataset.mode = joint.mode;
    const key = `${joint.mode}|${joint.modes}|${joint.interactions}|${joint.interaction}|${joint.limits.lower}|${joint.limits.upper}|${joint.limits.velocity}|${unitOf("position", joint.sliding)[1]}|${joint.sliding}`;
    if (key !== this.shownMode) {
      this.shownMode = key;
      this.drawModes();
      this.drawSliders();
    }
    this.panel.permit(this.element);
    this.details?.permit();
  }

  drawModes() {
    const { joint } = this;
    const codes = joint.modes.includes(joint.mode) ? joint.modes : [joint.mode, ...joint.modes];
    this.mode.replaceChildren(...codes.filter(Boolean).map((code) => h("option", { value: code, selected: code === joint.mode }, MODES[code] ?? code)));
    if (joint.mode === "hwfa") this.mode.append(h("option", { value: "fidl" }, "Clear the fault (idle)"));
    if (joint.mode === "cal") this.mode.append(h("option", { value: "fidl" }, "Abort (idle)"));
    this.mode.value = joint.mode;
    this.interaction.hidden = joint.interactions.length < 2;
    segmented(this.interaction, `Interaction of ${joint.short}`,
      Object.fromEntries(joint.interactions.map((code) => [code, INTERACTIONS[code]])), joint.interaction,
      (code) => this.panel.request("interaction", { ...this.where, mode: code }));
    for (const button of this.interaction.children) button.classList.add("command");
  }

  drawSliders() {
    for (const slider of this.sliders) slider.close?.();
    this.sliders = (TAKES[this.joint.mode] ?? []).map((kind) => this.slider(kind));
    if (!this.sliders.length) {
      const shown = new PositionSlider(this.joint, { send: () => {}, isLive: () => false });
      shown.element.classList.add("still");
      shown.input.tabIndex = -1;
      for (const input of [shown.input, shown.box]) { input.disabled = true; input.classList.remove("command"); }
      this.sliders = [shown];
    }
    this.slots.replaceChildren(...this.sliders.map((slider) => slider.element));
  }

  slider(kind) {
    const { joint, panel } = this;
    if (kind === "position" || kind === "direct") {
      return new PositionSlider(joint, {
        isLive: () => panel.live,
        send: (value) => panel.request(kind, { ...this.where, positions: [value] }),
      });
    }
    const where = { board: joint.board.name, joint: joint.name, kind };
    return new HoldSlider(joint, kind, {
      hold: (value) => panel.hold({ ...where, value }),
      release: () => panel.release(where),
    });
  }

  expand() {
    const open = this.body.hidden;
    this.body.hidden = !open;
    this.more.setAttribute("aria-expanded", String(open));
    if (open) {
      this.details = new Details(this.joint, this.panel);
      this.body.replaceChildren(this.details.element);
    } else {
      this.details = null;
      this.body.replaceChildren();
    }
  }

  /** With every frame: the marks. */
  draw() { for (const slider of this.sliders) slider.draw(); }

  /** A few times a second: the numbers. */
  write() {
    const { joint } = this;
    for (const { signal, element, shown, unit } of [this.position, ...this.values]) {
      const value = joint.state?.[signal];
      const none = signal === "temperature" && !Number.isFinite(value);
      if (element.hidden !== none) element.hidden = none;
      setText(shown, number(value, signal, joint.sliding));
      setText(unit, unitOf(signal, joint.sliding)[1]);
    }
    const held = this.sliders.some((slider) => slider.timer);
    setText(this.why, held ? "" : joint.fault ? joint.fault.text : whyStill(joint));
    this.why.classList.toggle("fault", Boolean(joint.fault));
  }

  close() { for (const slider of this.sliders) slider.close?.(); }
}
