// SPDX-License-Identifier: Apache-2.0
// What is known of boards and joints, as the server tells it.

import { shortNames } from "./units.js";

const SIGNALS = ["position", "velocity", "torque", "position_reference", "velocity_reference",
  "torque_reference", "output", "current", "temperature"];

/** One joint, with what is known of it. */
class Joint {
  constructor(board, index, name, short) {
    Object.assign(this, { board, index, name, short, key: `${board.name} ${name}`, mode: "", interaction: "", fault: null,
      state: null, target: null, modes: [], interactions: [], kind: "", limits: {}, speed: null });
  }
  get sliding() { return this.kind === "prismatic"; }
  get lower() { return this.limits.lower ?? -Math.PI; }
  get upper() { return this.limits.upper ?? Math.PI; }
  get endless() { return this.limits.lower == null || this.limits.upper == null; }
}

class Board {
  constructor(name, number) {
    Object.assign(this, { name, number, joints: [], info: null, stamp: 0, faults: [], heard: 0 });
  }
  get space() { return this.name.slice(0, this.name.lastIndexOf("/")); }
  get title() { return this.name.replace(/^\//, ""); }
  rename(names) {
    if (names.length === this.joints.length && names.every((n, k) => n === this.joints[k].name)) return false;
    const shorts = shortNames(names);
    this.joints = names.map((name, k) => new Joint(this, k, name, shorts[k]));
    return true;
  }
  joint(name) { return this.joints.find((joint) => joint.name === name); }
}

export class Model extends EventTarget {
  constructor(connection) {
    super();
    this.boards = new Map();
    this.you = null;
    this.readOnly = false;
    this.operator = { holder: null, asking: null, browsers: {} };
    this.hidden = new Map(); // told before the list of boards was
    connection.on("hello", (m) => { this.you = m.you; this.readOnly = m.read_only; this.emit("operator"); });
    connection.on("operator", (m) => { this.operator = m; this.emit("operator"); });
    connection.on("boards", (m) => this.setBoards(m.boards));
    connection.on("info", (m) => this.withBoard(m.board, (board) => this.setInfo(board, m)));
    connection.on("modes", (m) => this.withBoard(m.board, (board) => this.setModes(board, m)));
    connection.on("faults", (m) => this.withBoard(m.board, (board) => this.setFaults(board, m.faults)));
    connection.on("targets", (m) => this.withBoard(m.board, (board) => {
      board.joints.forEach((joint, k) => { joint.target = m.targets[k] ?? null; });
    }));
    connection.on("frame", ({ number, state }) => this.setState(number, state));
    connection.on("closed", () => { this.you = null; this.operator = { holder: null, asking: null, browsers: {} }; this.emit("operator"); });
  }

  emit(name, detail) { this.dispatchEvent(Object.assign(new Event(name), { detail })); }
  on(name, listener) { this.addEventListener(name, (event) => listener(event.detail)); }

  get mayOperate() { return this.you !== null && this.you === this.operator.holder; }

  withBoard(name, change) {
    const board = this.boards.get(name) ?? this.hidden.get(name) ?? new Board(name, -1);
    if (!this.boards.has(name)) this.hidden.set(name, board);
    change(board);
  }

  setBoards(list) {
    const before = this.listed;
    const found = new Map();
    for (const { name, number } of list) {
      const board = this.boards.get(name) ?? this.hidden.get(name) ?? new Board(name, number);
      board.number = number;
      found.set(name, board);
    }
    this.hidden.clear();
    this.boards = found;
    this.listed = [...found.keys()].join();
    if (before !== this.listed) this.emit("boards");
  }

  setInfo(board, info) {
    const renamed = board.rename(info.names);
    board.info = info;
    board.joints.forEach((joint, k) => {
      joint.modes = info.control[k];
      joint.interactions = info.interaction[k];
      joint.kind = info.kinds[k];
      joint.maxStiffness = info.max_stiffness[k];
      joint.maxDamping = info.max_damping[k];
      joint.limits = Object.fromEntries(Object.entries(info.limits).map(([kind, values]) => [kind, values[k]]));
    });
    this.emit(renamed ? "boards" : "info", board);
  }

  setModes(board, modes) {
    const renamed = board.rename(modes.names);
    board.joints.forEach((joint, k) => {
      joint.mode = modes.control[k];
      joint.interaction = modes.interaction[k];
    });
    this.emit(renamed ? "boards" : "modes", board);
  }

  setFaults(board, faults) {
    board.faults = faults;
    for (const joint of board.joints) joint.fault = faults.find((fault) => fault.name === joint.name) ?? null;
    this.emit("faults", board);
  }

  setState(number, state) {
    const board = [...this.boards.values()].find((b) => b.number === number);
    if (!board) return;
    if (board.rename(state.names)) this.emit("boards");
    const states = state.names.map((_, k) => {
      const one = { motion_done: state.motion_done[k], rejected: state.rejected_commands[k], calibrated: state.calibrated[k] };
      for (const signal of SIGNALS) one[signal] = state[signal][k];
      return one;
    });
    const places = new Map(state.names.map((name, k) => [name, k]));
    for (const shown of [board, ...this.partsOf(board)]) {
      shown.stamp = state.stamp;
      shown.heard = performance.now();
      for (const joint of shown.joints) joint.state = states[places.get(joint.name)];
      this.emit("state", shown);
    }
  }

  /** The boards that a robot's own board repeats, all of them; none of any other board. */
  partsOf(whole) {
    if (whole.joints.length < 2) return [];
    const names = new Set(whole.joints.map((joint) => joint.name));
    const parts = [...this.boards.values()].filter((board) => board !== whole && board.space === whole.space
      && board.joints.length && board.joints.every((joint) => names.has(joint.name)));
    return parts.reduce((sum, part) => sum + part.joints.length, 0) === names.size ? parts : [];
  }

  /** The boards to watch in order to see these: a robot's own, where all its parts are among them. */
  sources(boards) {
    let left = [...boards];
    const found = [];
    for (const whole of this.boards.values()) {
      const parts = this.partsOf(whole);
      if (!parts.length || !parts.every((part) => left.includes(part))) continue;
      found.push(whole);
      left = left.filter((board) => !parts.includes(board));
    }
    return [...found, ...left];
  }

  /** Boards that are no sum of others: a robot's own node repeats its parts. */
  get parts() {
    const boards = [...this.boards.values()];
    return boards.filter((board) => {
      const names = new Set(board.joints.map((joint) => joint.name));
      const inside = boards.filter((other) => other !== board && other.joints.length
        && other.joints.length < names.size && other.joints.every((joint) => names.has(joint.name)));
      return inside.reduce((sum, other) => sum + other.joints.length, 0) < Math.max(names.size, 1);
    });
  }
}
