// SPDX-License-Identifier: Apache-2.0
// @ts-check
// Details of a joint: speeds, impedance, gains, calibration.

import { button, h, setText } from "./dom.js";
import { LABELS, number, parse, quantity, unitOf } from "./units.js";

const TITLES = { speed: "Reference speed", acceleration: "Reference acceleration", stiffness: "Stiffness",
  damping: "Damping" };
const GAINS = ["kp", "ki", "kd", "kff", "integral_limit", "derivative_cutoff"];
const CONTROLLERS = { position: "Position PID", direct: "Direct PID", torque: "Torque PID", current: "Current PID" };
// Measurements of the motor, beside current, output and temperature on the card.
const MOTOR = ["motor_position", "motor_velocity", "acceleration", "supply_voltage", "external_torque"];
const plain = (value) => (value === null || value === undefined ? "–" : String(Number(value.toPrecision(6))));

/** A group of numbers applied together: values in force and wanted. */
class Group {
  /** @param {string} title @param {Field[]} fields @param {Panel} panel @param {Function} apply */
  constructor(title, fields, panel, apply) {
    this.panel = panel;
    this.rows = fields.map((field) => {
      const now = h("span", { class: "now" });
      const input = h("input", { class: "number command", type: "text", inputmode: "decimal", autocomplete: "off",
        "aria-label": `${title}: ${field.title}, wanted` });
      input.addEventListener("input", () => this.changed());
      input.addEventListener("keydown", (event) => { if (event.key === "Enter") this.send(); });
      return { field, now, input, value: null,
        element: h("label", { class: "row" }, h("span", { class: "name" }, field.title), now, input,
          h("span", { class: "u" }, field.unit())) };
    });
    this.apply = button("command primary", `Apply ${title}`, () => this.send(), "Apply");
    this.revert = button("", `Revert ${title}`, () => this.reset(), "Revert");
    this.sendValues = apply;
    this.element = h("fieldset", { class: "group" }, h("legend", {}, title), ...this.rows.map((row) => row.element),
      h("div", { class: "buttons" }, this.apply, this.revert));
  }

  /** Values in force; a value being typed stays. */
  fill(values) {
    for (const row of this.rows) {
      const typed = row.input.value !== (row.value === null ? "" : row.field.show(row.value));
      row.value = values[row.field.name] ?? null;
      setText(row.now, row.field.show(row.value));
      if (!typed) row.input.value = row.value === null ? "" : row.field.show(row.value);
    }
    this.changed();
  }

  reset() {
    for (const row of this.rows) {
      row.input.value = row.value === null ? "" : row.field.show(row.value);
      row.input.classList.remove("wrong");
    }
    this.changed();
  }

  wanted() {
    const found = {};
    for (const row of this.rows) {
      if (row.input.value === (row.value === null ? "" : row.field.show(row.value))) continue;
      const value = row.field.parse(row.input.value);
      row.input.classList.toggle("wrong", value === null);
      if (value === null) return null;
      found[row.field.name] = value;
    }
    return found;
  }

  changed() {
    const wanted = this.wanted();
    const differs = wanted === null || Object.keys(wanted).length > 0;
    this.element.classList.toggle("differs", differs);
    this.apply.dataset.idle = String(!differs || wanted === null);
    this.revert.disabled = !differs;
    this.panel.permit(this.element);
  }

  async send() {
    const wanted = this.wanted();
    if (wanted && Object.keys(wanted).length) await this.sendValues(wanted);
  }
}

export class Details {
  /** @param {Joint} joint @param {Panel} panel */
  constructor(joint, panel) {
    this.joint = joint;
    this.panel = panel;
    const one = { board: joint.board.name, joints: [joint.name] };
    const quantity = (name) => ({
      name, title: TITLES[name], unit: () => unitOf(name, joint.sliding)[1],
      show: (value) => number(value, name, joint.sliding), parse: (text) => parse(text, name, joint.sliding),
    });
    const again = (answer) => { this.load(); return answer; };
    this.speeds = new Group("Speeds", ["speed", "acceleration"].map(quantity), panel,
      (wanted) => panel.request("speed", { ...one, ...wanted }).then(again));
    this.impedance = joint.interactions.includes("comp")
      ? new Group("Impedance", ["stiffness", "damping"].map(quantity), panel,
        (wanted) => panel.request("impedance", { ...one, ...wanted }).then(again)) : null;
    this.gains = h("div", { class: "gains" });
    this.groups = new Map();
    this.calibrate = button("command", `Calibrate ${joint.label}`, () => this.runCalibration(), "Calibrate");
    this.idle = button("command", `Force ${joint.label} to idle: no power`,
      () => panel.request("mode", { ...one, mode: "fidl" }), "Force idle");
    this.size = h("input", { class: "number command", type: "text", inputmode: "decimal", autocomplete: "off",
      "aria-label": `Size of a step of ${joint.label}, amplitude of a chirp` });
    this.size.value = number(joint.sliding ? 0.005 : Math.PI / 36, "position", joint.sliding);
    const measure = (verb, text, words) =>
      button("command", `${text} of ${joint.label}`, () => this.measure(verb, words), text);
    this.step = measure("step", "Step", "steps there and back by");
    this.chirp = measure("chirp", "Chirp", "swings for a minute by up to");
    this.progress = h("progress", { max: 1, value: 0, hidden: true, "aria-label": `Calibration of ${joint.label}` });
    this.phase = h("span", { class: "phase" });
    this.motor = MOTOR.map((signal) => {
      const shown = h("b", {});
      return { signal, shown, element: h("span", { hidden: true }, `${LABELS[signal]} `, shown) };
    });
    this.element = h("div", {},
      h("p", { class: "motor", role: "group", "aria-label": `Motor of ${joint.label}` },
        ...this.motor.map((one) => one.element)),
      h("div", { class: "groups" }, this.speeds.element, this.impedance?.element),
      h("details", { class: "gain-box", "aria-label": `Gains of ${joint.label}` }, h("summary", {}, "Gains"),
        this.gains),
      h("div", { class: "buttons" }, this.calibrate, this.idle, this.step, this.chirp, this.size,
        h("span", { class: "u" }, unitOf("position", joint.sliding)[1]), this.progress, this.phase));
    this.load();
  }

  /** Update the motor's measurements: a few times a second. */
  write() {
    for (const { signal, shown, element } of this.motor) {
      const value = this.joint.state?.[signal];
      element.hidden = !Number.isFinite(value);
      setText(shown, quantity(value, signal, this.joint.sliding));
    }
  }

  permit() { this.panel.permit(this.element); }

  async load() {
    const answer = await this.panel.ask("details", { board: this.joint.board.name, joint: this.joint.name });
    if (!answer.ok) { setText(this.phase, answer.message); return; }
    const { details } = answer;
    this.joint.speed = details.speed;
    this.speeds.fill(details);
    this.impedance?.fill(details);
    for (const [controller, values] of Object.entries(details.gains)) this.fillGains(controller, values);
    this.permit();
  }

  fillGains(controller, values) {
    let group = this.groups.get(controller);
    if (!group) {
      const fields = GAINS.filter((gain) => gain in values).map((gain) => ({
        name: gain, title: gain.replace("_", " "), unit: () => "", show: plain,
        parse: (text) => (text.trim() && Number.isFinite(Number(text)) ? Number(text) : null),
      }));
      group = new Group(CONTROLLERS[controller], fields, this.panel, (wanted) => this.panel.request("gains", {
        board: this.joint.board.name, joint: this.joint.name, controller, gains: wanted,
      }).then((answer) => { this.load(); return answer; }));
      this.groups.set(controller, group);
      this.gains.append(group.element);
    }
    group.fill(values);
  }

  /** A step or a chirp: confirmed, recorded, its report opened. */
  async measure(verb, words) {
    const { joint, panel } = this;
    const size = parse(this.size.value, "position", joint.sliding);
    this.size.classList.toggle("wrong", size === null);
    const what = `${joint.short} ${words} ${this.size.value} ${unitOf("position", joint.sliding)[1]}`;
    if (size === null || !await panel.questions.ask(`${what}. Esc stops it.`, "Measure")) return;
    setText(this.phase, `${verb} …`);
    const answer = await panel.request(verb,
      { board: joint.board.name, joint: joint.name, [verb === "step" ? "size" : "amplitude"]: size });
    setText(this.phase, answer.ok ? "" : answer.message);
    if (answer.ok) panel.recording.open(answer.report);
  }

  async runCalibration() {
    this.progress.hidden = false;
    const show = ({ share, words }) => { this.progress.value = share; setText(this.phase, words); };
    const answer = await this.panel.request("calibrate", { board: this.joint.board.name, joints: [this.joint.name] },
      show);
    this.progress.hidden = true;
    setText(this.phase, answer.ok ? "calibrated" : answer.message);
  }
}
