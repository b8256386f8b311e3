// SPDX-License-Identifier: Apache-2.0
// @ts-check
// Sliders: one sends a position on release, one acts only while held.

import { button, h, icon, toast } from "./dom.js";
import { inDegrees, number, parse, quantity, unitOf } from "./units.js";

const LIVE_EVERY = 50; // ms between positions in live mode
const CONFIRM_EVERY = 60; // ms between confirmations of a held control
const SENT = 1200; // ms that a sent value is shown at most, until the board's target
const STEPS = [-5, -1, 1, 5]; // degrees, mm, or hundredths of a rad
const HANDLE = 16; // px, width of a slider's handle; beside it is the track
const TOUCH_DELAY = 150; // ms that a finger rests on a button before it acts: not for scrolling
const SLIP = 8; // px that it may move in this time

const percent = (value, lower, upper) =>
  `${(100 * Math.min(Math.max((value - lower) / (upper - lower), 0), 1)).toFixed(2)}%`;

function range(label, lower, upper, step) {
  const input = h("input", { type: "range", "aria-label": label, class: "range command" });
  Object.assign(input, { min: String(lower), max: String(upper), step: String(step) });
  return input;
}

/** A handle for a finger; cancelled by scrolling, by the system, by leaving the page. */
function dragHandle(handle, input, { begin, move, end, cancel }) {
  let finger = null;
  const value = (event) => {
    const box = handle.parentElement.getBoundingClientRect();
    const [low, high] = [Number(input.min), Number(input.max)];
    return low + (high - low) * Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1);
  };
  handle.addEventListener("pointerdown", (event) => {
    if (input.disabled || finger !== null) return;
    finger = event.pointerId;
    handle.setPointerCapture(finger);
    begin();
  });
  handle.addEventListener("pointermove", (event) => { if (event.pointerId === finger) move(value(event)); });
  handle.addEventListener("pointerup", (event) => { if (event.pointerId === finger) { finger = null; end(); } });
  for (const name of ["pointercancel", "lostpointercapture"]) {
    handle.addEventListener(name, (event) => { if (event.pointerId === finger) { finger = null; cancel(); } });
  }
}

/** A slider for positions, with marks for measurement and target. On touch screens only its handle moves it. */
export class PositionSlider {
  /** @param {Joint} joint */
  constructor(joint, { send, isLive, ask }) {
    this.joint = joint;
    this.send = send;
    this.isLive = isLive;
    this.ask = ask;
    this.dragging = this.onHandle = this.voided = false;
    this.sentAt = -Infinity;
    this.measured = h("span", { class: "mark measured", title: "measured" });
    this.target = h("span", { class: "mark target", title: "target" });
    this.fill = h("span", { class: "fill" });
    this.input = range(`Position reference of ${joint.label}`, 0, 1, 0.001);
    this.handle = h("span", { class: "handle", "aria-hidden": "true" });
    this.lower = h("span", { class: "limit" });
    this.upper = h("span", { class: "limit" });
    this.box = h("input", { class: "number command", type: "text", inputmode: "decimal", autocomplete: "off",
      "aria-label": `Position reference of ${joint.label}, typed; Enter sends` });
    this.element = h("div", { class: "slider" }, this.lower,
      h("div", { class: "track" }, this.fill, this.target, this.measured, this.input, this.handle),
      this.upper, this.box);
    this.steps = h("div", { class: "steps", role: "group", "aria-label": `Steps of ${joint.label}` });
    this.input.addEventListener("pointerdown",
      (event) => this.begin(Math.abs(event.clientX - this.handleAt()) <= HANDLE));
    this.input.addEventListener("pointercancel", () => this.drop());
    this.input.addEventListener("keydown", () => this.begin(false));
    this.input.addEventListener("input", () => this.moved());
    this.input.addEventListener("change", () => { if (this.dragging) this.released(); });
    dragHandle(this.handle, this.input, {
      begin: () => this.begin(true),
      move: (value) => { this.input.value = String(value); this.moved(); },
      end: () => { if (this.dragging) this.released(); },
      cancel: () => this.drop(),
    });
    this.box.addEventListener("keydown", (event) => {
      if (event.key === "Enter") { event.preventDefault(); this.typed(); } // it must not answer the question, too
      if (event.key === "Escape") this.box.blur();
    });
    this.box.addEventListener("input", () => this.box.classList.remove("wrong"));
    this.box.addEventListener("focus", () => this.box.select());
    this.layout();
  }

  layout() {
    const { joint } = this;
    const step = joint.sliding ? 0.001 : inDegrees() ? Math.PI / 180 : 0.01;
    Object.assign(this.input, { min: String(joint.lower), max: String(joint.upper), step: String(step / 10) });
    this.step = step;
    const unit = joint.sliding ? " mm" : inDegrees() ? "°" : " rad";
    this.steps.replaceChildren(...STEPS.map((count) => {
      const size = joint.sliding || inDegrees() ? Math.abs(count) : Math.abs(count) / 100;
      const way = `${count < 0 ? "−" : "+"}${size}${unit}`;
      return button("command", `${joint.label} ${way}`, () => this.stepped(count * step), way);
    }));
    this.lower.textContent = joint.endless ? "∞" : number(joint.lower, "position", joint.sliding).replace(/\.0$/, "");
    this.upper.textContent = joint.endless ? "∞" : number(joint.upper, "position", joint.sliding).replace(/\.0$/, "");
  }

  /** Position of the handle on the screen, px. */
  handleAt() {
    const box = this.input.getBoundingClientRect();
    const { lower, upper } = this.joint;
    return box.left + HANDLE / 2
      + (box.width - HANDLE) * Math.min(Math.max((this.shown - lower) / (upper - lower), 0), 1);
  }

  /** Begin a pointer's or key's input, on the handle or not. */
  begin(onHandle) {
    this.onHandle = onHandle;
    this.voided = false;
  }

  moved() {
    if (this.voided) { this.draw(); return; }
    this.dragging = true;
    const value = Number(this.input.value);
    this.input.setAttribute("aria-valuetext", quantity(value, "position", this.joint.sliding));
    this.box.value = number(value, "position", this.joint.sliding);
    this.joint.proposed = value;
    if (this.isLive() && performance.now() - this.sentAt > LIVE_EVERY) this.give(value, true);
  }

  /** Released: a long way that no drag of the handle has shown is confirmed first. */
  released() {
    this.dragging = false;
    this.joint.proposed = null;
    const value = Number(this.input.value);
    if (this.onHandle || this.isLive()) this.give(value, this.isLive());
    else this.asked(value);
  }

  typed() {
    const { joint } = this;
    const value = parse(this.box.value, "position", joint.sliding);
    const range = [joint.lower, joint.upper].map((end) => quantity(end, "position", joint.sliding)).join(" to ");
    if (value === null) {
      const units = joint.sliding ? "mm or m" : "deg or rad";
      this.wrong(`${joint.short}: "${this.box.value}" is no position; type a number, ${units}`);
    } else if (!joint.endless && (value < joint.lower - 1e-9 || value > joint.upper + 1e-9)) {
      const typed = quantity(value, "position", joint.sliding);
      this.wrong(`${joint.short}: ${typed} is outside its limits, ${range}; nothing was sent`);
    } else {
      this.box.classList.remove("wrong");
      this.box.blur();
      this.asked(value);
    }
  }

  /** A step from the target, also from one that is not confirmed yet; it ends at a limit. */
  stepped(way) {
    const { joint } = this;
    const from = performance.now() - this.sentAt < SENT ? this.sent : joint.goal ?? joint.state?.position_reference;
    if (from === undefined) return;
    this.begin(false);
    this.asked(joint.endless ? from + way : Math.min(Math.max(from + way, joint.lower), joint.upper));
  }

  wrong(text) {
    this.box.classList.add("wrong");
    toast(text, true);
  }

  async asked(value) {
    this.joint.proposed = value;
    const yes = await this.ask(value);
    this.joint.proposed = null;
    if (yes) this.give(value);
    else this.drop();
  }

  give(value, live = false) {
    this.sentAt = performance.now();
    this.sent = value;
    this.input.value = String(value);
    this.send(value, live);
  }

  /** Cancel the input: nothing is sent, and the board's target is shown again. */
  drop() {
    this.dragging = false;
    this.voided = true; // also of a pointer that is still down
    this.sentAt = -Infinity;
    this.joint.proposed = null;
    this.draw();
  }

  draw() {
    const { joint } = this;
    if (!joint.state) return;
    const { lower, upper } = joint;
    const { position } = joint.state;
    const target = joint.goal ?? position;
    this.measured.style.left = percent(position, lower, upper);
    this.target.style.left = percent(target, lower, upper);
    this.fill.style.left = percent(Math.min(position, target), lower, upper);
    this.fill.style.right = `calc(100% - ${percent(Math.max(position, target), lower, upper)})`;
    const held = this.dragging || joint.proposed !== null || performance.now() - this.sentAt < SENT;
    if (!held) {
      this.shown = target;
      this.input.value = String(target);
      if (document.activeElement !== this.box) this.box.value = number(target, "position", joint.sliding);
    } else this.shown = Number(this.input.value);
    this.handle.style.left = percent(this.shown, lower, upper);
  }
}

/** A slider that acts while held, and two buttons likewise. */
export class HoldSlider {
  /** @param {Joint} joint @param {string} kind */
  constructor(joint, kind, { hold, release }) {
    this.joint = joint;
    this.kind = kind;
    this.hold = hold;
    this.release = release;
    this.timer = this.value = 0;
    const label = { velocity: "Velocity", veldirect: "Velocity", torque: "Torque", output: "Output",
      current: "Current" }[kind];
    this.zero = h("span", { class: "mark zero" });
    this.measured = h("span", { class: "mark measured", title: "measured" });
    this.input = range(`${label} of ${joint.label}, acts while held`, -1, 1, "any");
    this.input.classList.add("dead-man");
    this.box = h("input", { class: "number command", type: "text", inputmode: "decimal", autocomplete: "off",
      "aria-label": `${label} that the buttons of ${joint.label} give` });
    this.minus = this.jog(-1, `${label} of ${joint.label} down, while held`, "left");
    this.plus = this.jog(1, `${label} of ${joint.label} up, while held`, "right");
    this.unit = h("span", { class: "limit" });
    this.handle = h("span", { class: "handle", "aria-hidden": "true" });
    this.element = h("div", { class: "slider hold" }, this.minus,
      h("div", { class: "track" }, this.zero, this.measured, this.input, this.handle), this.plus, this.box, this.unit);
    dragHandle(this.handle, this.input, {
      begin: () => { this.pressed = true; },
      move: (value) => this.begin(value, this.handle),
      end: () => this.end(this.handle),
      cancel: () => this.end(this.handle),
    });
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
    return { velocity: limits.velocity ?? 1, torque: limits.torque ?? 10, output: limits.output ?? 100,
      veldirect: limits.velocity ?? 1, current: limits.peak_current ?? 1 }[this.kind];
  }

  layout() {
    const { limit, joint, kind } = this;
    Object.assign(this.input, { min: String(-limit), max: String(limit) });
    const speed = joint.sliding ? 0.02 : Math.PI / 18;
    const usual = { velocity: speed, torque: limit / 20, output: 5, veldirect: speed, current: limit / 20 }[kind];
    const shown = number(Math.min(usual, limit), kind, joint.sliding);
    if (this.box.value === (this.usual ?? "")) this.box.value = shown; // else it is typed
    this.usual = shown;
    this.unit.textContent = unitOf(kind, joint.sliding)[1];
  }

  jog(direction, label, shape) {
    const element = button("jog command", label, null, icon(shape), { title: "acts while held" });
    const start = () => this.begin(this.rest() + direction * this.typed(), element);
    element.addEventListener("pointerdown", (event) => this.press(event, element, start));
    element.addEventListener("keydown", (event) => {
      if ((event.key === " " || event.key === "Enter") && !event.repeat) start();
    });
    for (const name of ["pointerup", "pointercancel", "lostpointercapture", "keyup", "blur"]) {
      element.addEventListener(name, () => this.end(element));
    }
    element.addEventListener("contextmenu", (event) => event.preventDefault());
    return element;
  }

  /** A mouse acts at once, a finger once it rests: scrolling commands nothing. */
  press(event, button, start) {
    if (event.pointerType !== "touch") { button.setPointerCapture(event.pointerId); start(); return; }
    const rests = setTimeout(() => { settled(); button.setPointerCapture(event.pointerId); start(); }, TOUCH_DELAY);
    const slips = (moved) => {
      if (Math.hypot(moved.clientX - event.clientX, moved.clientY - event.clientY) > SLIP) settled();
    };
    const settled = () => {
      clearTimeout(rests);
      document.removeEventListener("pointermove", slips);
      for (const name of ["pointerup", "pointercancel"]) document.removeEventListener(name, settled);
    };
    document.addEventListener("pointermove", slips);
    for (const name of ["pointerup", "pointercancel"]) document.addEventListener(name, settled);
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

  /** Hold a control; only this one releases it, not another one's loss of focus. */
  begin(value, control) {
    this.control = control;
    this.value = Math.min(Math.max(value, -this.limit), this.limit);
    this.input.value = String(this.value);
    this.element.classList.add("held");
    if (this.timer) return;
    this.hold(this.value);
    this.timer = setInterval(() => this.hold(this.value), CONFIRM_EVERY);
  }

  /** Release the control; without one, any held control. */
  end(control = this.control) {
    if ([this.input, this.handle, this.control].includes(control)) this.pressed = false;
    if (control !== this.control) return;
    if (!this.timer) return;
    clearInterval(this.timer);
    this.timer = 0;
    this.element.classList.remove("held");
    this.release();
    this.input.value = String(this.rest());
  }

  /** End held controls: STOP. */
  drop() { this.end(); }

  draw() {
    const { joint, kind, limit } = this;
    if (!joint.state) return;
    const measured = joint.state[kind === "veldirect" ? "velocity" : kind];
    this.measured.style.left = percent(measured, -limit, limit);
    if (!this.timer && !this.pressed) this.input.value = String(this.rest());
    this.handle.style.left = percent(Number(this.input.value), -limit, limit);
    const shown = quantity(Number(this.input.value), kind, joint.sliding);
    if (this.input.getAttribute("aria-valuetext") !== shown) this.input.setAttribute("aria-valuetext", shown);
  }
}
