// SPDX-License-Identifier: Apache-2.0
// Sliders: one that sends a position when it is let go, and one that acts only while it is held.

import { h, icon } from "./dom.js";
import { inDegrees, number, parse, quantity, unitOf } from "./units.js";

const LIVE_EVERY = 50; // ms between positions in live mode
const CONFIRM_EVERY = 60; // ms between words that a control is still held

const percent = (value, lower, upper) => `${(100 * Math.min(Math.max((value - lower) / (upper - lower), 0), 1)).toFixed(2)}%`;

function range(label, lower, upper, step) {
  const input = h("input", { type: "range", "aria-label": label, class: "range command" });
  Object.assign(input, { min: String(lower), max: String(upper), step: String(step) });
  return input;
}

/** A slider for positions, with marks for measurement and target. */
export class PositionSlider {
  constructor(joint, { send, isLive }) {
    Object.assign(this, { joint, send, isLive, dragging: false, sentAt: 0 });
    this.measured = h("span", { class: "mark measured", title: "measured" });
    this.target = h("span", { class: "mark target", title: "target" });
    this.fill = h("span", { class: "fill" });
    this.input = range(`Position reference of ${joint.short}`, 0, 1, 0.001);
    this.lower = h("span", { class: "limit" });
    this.upper = h("span", { class: "limit" });
    this.box = h("input", { class: "number command", type: "text", inputmode: "decimal", autocomplete: "off",
      "aria-label": `Position reference of ${joint.short}, typed; Enter sends` });
    this.element = h("div", { class: "slider" }, this.lower,
      h("div", { class: "track" }, this.fill, this.target, this.measured, this.input), this.upper, this.box);
    this.input.addEventListener("input", () => this.moved());
    this.input.addEventListener("change", () => { this.dragging = false; this.give(Number(this.input.value)); });
    this.box.addEventListener("keydown", (event) => {
      if (event.key === "Enter") this.typed();
      if (event.key === "Escape") this.box.blur();
    });
    this.box.addEventListener("focus", () => this.box.select());
    this.layout();
  }

  layout() {
    const { joint } = this;
    const step = joint.sliding ? 0.001 : inDegrees() ? Math.PI / 180 : 0.01;
    Object.assign(this.input, { min: String(joint.lower), max: String(joint.upper), step: String(step / 10) });
    this.step = step;
    this.lower.textContent = joint.endless ? "∞" : number(joint.lower, "position", joint.sliding).replace(/\.0$/, "");
    this.upper.textContent = joint.endless ? "∞" : number(joint.upper, "position", joint.sliding).replace(/\.0$/, "");
  }

  moved() {
    this.dragging = true;
    const value = Number(this.input.value);
    this.input.setAttribute("aria-valuetext", quantity(value, "position", this.joint.sliding));
    this.box.value = number(value, "position", this.joint.sliding);
    if (this.isLive() && performance.now() - this.sentAt > LIVE_EVERY) this.give(value);
  }

  typed() {
    const value = parse(this.box.value, "position", this.joint.sliding);
    if (value === null) { this.box.classList.add("wrong"); return; }
    this.box.classList.remove("wrong");
    this.box.blur();
    this.give(value);
  }

  give(value) {
    this.sentAt = performance.now();
    this.send(value);
  }

  draw() {
    const { joint } = this;
    if (!joint.state) return;
    const { lower, upper } = joint;
    const following = joint.mode === "pos" || joint.mode === "mix" ? joint.target : null;
    const target = following ?? joint.state.position_reference;
    this.measured.style.left = percent(joint.state.position, lower, upper);
    this.target.style.left = percent(target, lower, upper);
    this.fill.style.left = percent(Math.min(joint.state.position, target), lower, upper);
    this.fill.style.right = `calc(100% - ${percent(Math.max(joint.state.position, target), lower, upper)})`;
    if (this.dragging || performance.now() - this.sentAt < 1200) return;
    this.input.value = String(target);
    if (document.activeElement !== this.box) this.box.value = number(target, "position", joint.sliding);
  }
}

/** A slider that acts while it is held, and two buttons that do the same. */
export class HoldSlider {
  constructor(joint, kind, { hold, release }) {
    Object.assign(this, { joint, kind, hold, release, timer: 0, value: 0 });
    const label = { velocity: "Velocity", torque: "Torque", output: "Output" }[kind];
    this.zero = h("span", { class: "mark zero" });
    this.measured = h("span", { class: "mark measured", title: "measured" });
    this.input = range(`${label} of ${joint.short}, acts while held`, -1, 1, "any");
    this.input.classList.add("dead-man");
    this.box = h("input", { class: "number command", type: "text", inputmode: "decimal", autocomplete: "off",
      "aria-label": `${label} that the buttons of ${joint.short} give` });
    this.minus = this.button(-1, `${label} of ${joint.short} down, while held`, "left");
    this.plus = this.button(1, `${label} of ${joint.short} up, while held`, "right");
    this.unit = h("span", { class: "limit" });
    this.element = h("div", { class: "slider hold" }, this.minus,
      h("div", { class: "track" }, this.zero, this.measured, this.input), this.plus, this.box, this.unit);
    this.input.addEventListener("pointerdown", () => { this.pressed = true; });
    this.input.addEventListener("input", () => { if (this.pressed) this.begin(Number(this.input.value), this.input); });
    this.input.addEventListener("keydown", (event) => this.key(event));
    for (const name of ["pointerup", "pointercancel", "lostpointercapture", "keyup", "blur", "change"]) {
      this.input.addEventListener(name, () => this.end(this.input));
    }
    this.ends = () => this.end();
    document.addEventListener("visibilitychange", this.ends);
    for (const name of ["blur", "pagehide"]) window.addEventListener(name, this.ends);
    this.layout();
  }

  close() {
    this.end();
    document.removeEventListener("visibilitychange", this.ends);
    for (const name of ["blur", "pagehide"]) window.removeEventListener(name, this.ends);
  }

  get limit() {
    const { limits } = this.joint;
    return { velocity: limits.velocity ?? 1, torque: limits.torque ?? 10, output: limits.output ?? 100 }[this.kind];
  }

  layout() {
    const { limit, joint, kind } = this;
    Object.assign(this.input, { min: String(-limit), max: String(limit) });
    const usual = { velocity: joint.sliding ? 0.02 : Math.PI / 18, torque: limit / 20, output: 5 }[kind];
    this.box.value = number(Math.min(usual, limit), kind, joint.sliding);
    this.unit.textContent = unitOf(kind, joint.sliding)[1];
  }

  button(direction, label, shape) {
    const button = h("button", { type: "button", class: "jog command", "aria-label": label, title: "acts while held" }, icon(shape));
    const start = () => this.begin(this.rest() + direction * this.typed(), button);
    button.addEventListener("pointerdown", (event) => { button.setPointerCapture(event.pointerId); start(); });
    button.addEventListener("keydown", (event) => {
      if ((event.key === " " || event.key === "Enter") && !event.repeat) start();
    });
    for (const name of ["pointerup", "pointercancel", "lostpointercapture", "keyup", "blur"]) {
      button.addEventListener(name, () => this.end(button));
    }
    button.addEventListener("contextmenu", (event) => event.preventDefault());
    return button;
  }

  typed() { return Math.abs(parse(this.box.value, this.kind, this.joint.sliding) ?? 0); }

  rest() { return this.kind === "torque" ? this.joint.state?.torque_reference ?? 0 : 0; }

  key(event) {
    const direction = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
    if (direction === undefined) {
      if (["Home", "End", "PageUp", "PageDown"].includes(event.key)) event.preventDefault();
      return;
    }
    event.preventDefault();
    if (!event.repeat) this.begin(this.rest() + direction * this.typed(), this.input);
  }

  /** A control is held; it is the one that lets go, too: another one only loses its focus. */
  begin(value, control) {
    this.control = control;
    this.value = Math.min(Math.max(value, -this.limit), this.limit);
    this.input.value = String(this.value);
    this.element.classList.add("held");
    if (this.timer) return;
    this.hold(this.value);
    this.timer = setInterval(() => this.hold(this.value), CONFIRM_EVERY);
  }

  /** The control lets go; without one, whatever is held does. */
  end(control = this.control) {
    if (control === this.input || control === this.control) this.pressed = false;
    if (control !== this.control) return;
    if (!this.timer) return;
    clearInterval(this.timer);
    this.timer = 0;
    this.element.classList.remove("held");
    this.release();
    this.input.value = String(this.rest());
  }

  draw() {
    const { joint, kind, limit } = this;
    if (!joint.state) return;
    const measured = { velocity: joint.state.velocity, torque: joint.state.torque, output: joint.state.output }[kind];
    this.measured.style.left = percent(measured, -limit, limit);
    if (!this.timer && !this.pressed) this.input.value = String(this.rest());
    const shown = quantity(Number(this.input.value), kind, joint.sliding);
    if (this.input.getAttribute("aria-valuetext") !== shown) this.input.setAttribute("aria-valuetext", shown);
  }
}
