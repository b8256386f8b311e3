// SPDX-License-Identifier: Apache-2.0
// @ts-check
// Modes for people: names, colours (in style.css, by code), what each accepts, why nothing moves.

import { quantity } from "./units.js";

/** A table of words; foreign codes such as "constructor" or "__proto__" find nothing in it. */
const table = (words) => Object.assign(Object.create(null), words);

export const MODES = table({
  pos: "Position", posd: "Position direct", vel: "Velocity", mix: "Mixed", torq: "Torque",
  open: "Open loop", veld: "Velocity direct", icur: "Current", idl: "Idle", hwfa: "Hardware fault", cal: "Calibrating",
  cfgn: "Not configured",
});
export const INTERACTIONS = table({ stif: "Stiff", comp: "Compliant" });

/** The references a mode accepts: position (a slider that sends), or a hold (acts while held). */
export const TAKES = table({
  pos: ["position"], posd: ["direct"], mix: ["position", "velocity"], vel: ["velocity"],
  torq: ["torque"], open: ["output"], veld: ["veldirect"], icur: ["current"],
});

const WHY = table({
  idl: "Idle: no power. Choose a mode to hold the joint.",
  hwfa: "In fault: no power. Clear the fault first.",
  cal: "Calibrating: commands wait until it is done.",
  cfgn: "Not configured: the board waits for its configuration.",
  vel: "Velocity is zero. Hold the slider to move.",
  torq: "Torque control: the joint follows its load until the slider is held.",
  open: "Output is 0 %: nothing drives the joint until the slider is held.",
  veld: "Velocity is zero. Hold the slider to move.",
  icur: "Current control: it carries its load until the slider is held, then gets 0 A.",
});

const CARRIES = 0.02; // share of the torque limit: a joint under less neither falls nor runs
const FREE = table({
  idl: (load) => `Without power it falls: it carries ${load}.`,
  torq: (load) => `In torque control nothing holds its place: it keeps ${load}, and runs when its load changes.`,
  open: (load) => `At an output of 0 % it falls: it carries ${load}.`,
  icur: (load) => `In current control nothing holds its place: it carries ${load}, and runs when its load changes.`,
});

/** The effect of a change of mode on a loaded joint; empty if it stays. @param {Joint} joint @param {string} mode */
export function whatFalls(joint, mode) {
  const { state } = joint;
  if (mode === "idl" && joint.hasBrake) return "";
  if (!state || !FREE[mode] || mode === joint.mode || !(joint.mode in TAKES)) return "";
  if (Math.abs(state.torque) <= CARRIES * (joint.limits.torque ?? 0)) return "";
  return FREE[mode](quantity(state.torque, "torque", joint.sliding));
}

/** Why a joint does not move, or that a move is active; empty otherwise. @param {Joint} joint */
export function whyStill(joint) {
  const { mode, state } = joint;
  if (!state) return "Waiting for its state.";
  if (joint.board.silence) return `No state for ${joint.board.silence.toFixed(1)} s: the board does not answer.`;
  if (!state.calibrated) return "Uncalibrated: calibrate the joint first.";
  if ((mode === "vel" || mode === "veld") && Math.abs(state.velocity_reference) > 1e-4) return "";
  if (mode === "open" && Math.abs(state.output) > 0.05) return "";
  if ((mode === "pos" || mode === "mix") && joint.speed === 0) return "Its reference speed is zero.";
  if (!state.motion_done && !WHY[mode]) return "Moving.";
  const held = state.brake ? " Its brake is closed." : "";
  return `${WHY[mode] ?? ""}${held}`.trim();
}
