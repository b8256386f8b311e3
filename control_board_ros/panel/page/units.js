// SPDX-License-Identifier: Apache-2.0
// @ts-check
// Quantities for display: degrees or radians, millimetres, others in the board's units.

const DEGREE = Math.PI / 180;
let degrees = (localStorage.getItem("unit") ?? "deg") === "deg";

export const inDegrees = () => degrees;
export function setDegrees(value) {
  degrees = value;
  localStorage.setItem("unit", value ? "deg" : "rad");
}

/** Factor to the shown unit, its name, and digits behind the point. @returns {[number, string, number]} */
export function unitOf(signal, sliding) {
  /** @type {[number, string, number]} */
  const angle = sliding ? [1000, "mm", 1] : degrees ? [1 / DEGREE, "°", 1] : [1, "rad", 3];
  switch (signal) {
    case "position": case "position_reference": case "target": return angle;
    case "velocity": case "velocity_reference": case "veldirect": case "speed":
      return sliding ? [1000, "mm/s", 1] : degrees ? [1 / DEGREE, "°/s", 1] : [1, "rad/s", 3];
    case "acceleration":
      return sliding ? [1000, "mm/s²", 0] : degrees ? [1 / DEGREE, "°/s²", 0] : [1, "rad/s²", 2];
    case "torque": case "torque_reference": case "external_torque": return [1, sliding ? "N" : "N·m", 2];
    case "stiffness": return [1, sliding ? "N/m" : "N·m/rad", 1];
    case "damping": return [1, sliding ? "N·s/m" : "N·m·s/rad", 2];
    case "output": return [1, "%", 1];
    case "current": return [1, "A", 2];
    case "temperature": return [1, "°C", 1];
    case "motor_position": return degrees ? [1 / DEGREE, "°", 1] : [1, "rad", 3];
    case "motor_velocity": return degrees ? [1 / DEGREE, "°/s", 0] : [1, "rad/s", 1];
    case "supply_voltage": return [1, "V", 1];
    default: return [1, "", 3];
  }
}

export const LABELS = {
  position: "Position", velocity: "Velocity", torque: "Torque", position_reference: "Reference",
  velocity_reference: "Velocity ref.", torque_reference: "Torque ref.", output: "Output",
  current: "Current", temperature: "Temperature", motor_position: "Motor", motor_velocity: "Motor speed",
  acceleration: "Acceleration", supply_voltage: "Supply", external_torque: "External torque",
};

/** A number in its shown unit, without −0. */
export function number(value, signal, sliding) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const [factor, , digits] = unitOf(signal, sliding);
  const shown = (value * factor).toFixed(digits);
  return (Number(shown) === 0 ? shown.replace("-", "") : shown).replace("-", "−");
}

export function quantity(value, signal, sliding) {
  const unit = unitOf(signal, sliding)[1];
  const gap = unit === "°" ? "" : " ";
  return `${number(value, signal, sliding)}${gap}${unit}`;
}

// Accepted units of positions, speeds and accelerations, as factors to the board's.
const GIVEN = { rad: new Map([["deg", DEGREE], ["°", DEGREE], ["rad", 1]]),
  m: new Map([["mm", 0.001], ["cm", 0.01], ["m", 1]]) };

/** A typed value in the board's unit, also "90deg" and "1.5rad"; null if invalid. */
export function parse(text, signal, sliding) {
  const found = /^\s*([-+−]?\d*[.,]?\d+(?:e[-+]?\d+)?)\s*(.*?)\s*$/i.exec(text);
  if (!found) return null;
  const value = Number(found[1].replace("−", "-").replace(",", "."));
  const [factor, unit] = unitOf(signal, sliding);
  const given = found[2];
  if (!given || given === unit) return value / factor;
  const [, per] = /^(?:°|rad|mm)(\/s²?|)$/.exec(unit) ?? []; // of an angle or a length: what follows its unit
  if (per === undefined || !given.endsWith(per)) return null;
  const scale = GIVEN[sliding ? "m" : "rad"].get(given.slice(0, given.length - per.length));
  return scale === undefined ? null : value * scale;
}

/** Names without their common beginning: lbr_iiwa_joint_1 → joint_1. */
export function shortNames(names) {
  if (names.length < 2) return [...names];
  let front = names.reduce((a, b) => { let k = 0; while (k < a.length && a[k] === b[k]) k++; return a.slice(0, k); });
  front = front.slice(0, front.lastIndexOf("_") + 1);
  const words = front.split("_").filter(Boolean);
  const kept = words.length ? `${words.at(-1)}_` : "";
  const bare = names.some((name) => /^\d*$/.test(name.slice(front.length)));
  return names.map((name) => (bare ? kept : "") + name.slice(front.length) || name);
}
