// SPDX-License-Identifier: Apache-2.0
// @ts-check
// Boards and joints, as the server reports them.

import { shortNames } from "./units.js";

const SIGNALS = ["position", "velocity", "torque", "position_reference", "velocity_reference",
  "torque_reference", "output", "current", "temperature", "motor_position", "motor_velocity", "acceleration",
  "supply_voltage", "external_torque"];

const SILENT = 800; // ms without a state after which a board counts as gone
const DRAWN = 150; // ms that a frame of the page counts for at most

/** One joint: limits, modes, state, target. */
export class Joint {
  /** @param {Board} board @param {number} index @param {string} name @param {string} short */
  constructor(board, index, name, short) {
    this.board = board;
    this.index = index;
    this.name = name;
    this.short = this.label = short;
    this.key = `${board.name} ${name}`;
    this.mode = this.interaction = this.kind = "";
    this.modes = [];
    this.interactions = [];
    /** @type {Fault | null} */
    this.fault = null;
    this.state = this.target = this.proposed = this.speed = null;
    /** @type {Limits} */
    this.limits = {};
    this.hasBrake = false;
  }

  /** External torque as a share of a quarter of the limit, −1 to 1; null where it is not known. */
  get externalShare() {
    const torque = this.state?.external_torque;
    if (!Number.isFinite(torque) || !this.limits.torque) return null;
    return Math.max(-1, Math.min(1, torque / (0.25 * this.limits.torque)));
  }
  /** The target of the active move, of any program; null without a move, or if unknown. */
  get goal() { return this.state && !this.state.motion_done ? this.target : null; }
  get sliding() { return this.kind === "prismatic"; }
  get lower() { return this.limits.lower ?? -Math.PI; }
  get upper() { return this.limits.upper ?? Math.PI; }
  get endless() { return this.limits.lower == null || this.limits.upper == null; }
}

export class Board {
  /** @param {string} name @param {number} number */
  constructor(name, number) {
    this.name = name;
    this.number = number;
    /** @type {Joint[]} */
    this.joints = [];
    /** @type {Fault[]} */
    this.faults = [];
    this.info = null;
    this.stamp = this.received = this.interval = this.quiet = 0;
  }
  /** A state is received at a time of the page, ms. */
  receive(now) {
    if (this.received) this.interval += 0.1 * (Math.min(now - this.received, 1000) - this.interval);
    this.received = now;
    this.quiet = 0;
  }
  /** Seconds without a state if longer than usual; else 0. */
  get silence() {
    if (!this.received || this.quiet <= Math.max(SILENT, 4 * this.interval)) return 0;
    return (performance.now() - this.received) / 1000;
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
  /** @param {Connection} connection */
  constructor(connection) {
    super();
    /** @type {Map<string, Board>} */
    this.boards = new Map();
    this.you = null;
    this.readOnly = false;
    this.operator = { holder: null, asking: null, browsers: {} };
    this.hidden = new Map(); // received before the list of boards
    connection.on("hello", (m) => { this.you = m.you; this.readOnly = m.read_only; this.emit("operator"); });
    connection.on("operator", (m) => { this.operator = m; this.emit("operator"); });
    connection.on("boards", (m) => this.setBoards(m.boards));
    connection.on("info", (m) => this.withBoard(m.board, (board) => this.setInfo(board, m)));
    connection.on("modes", (m) => this.withBoard(m.board, (board) => this.setModes(board, m)));
    connection.on("faults", (m) => this.withBoard(m.board, (board) => this.setFaults(board, m.faults)));
    connection.on("targets", (m) => this.withBoard(m.board, (board) => this.setTargets(board, m.targets)));
    connection.on("frame", ({ number, state }) => this.setState(number, state));
    connection.on("closed", () => {
      this.you = null;
      this.operator = { holder: null, asking: null, browsers: {} };
      this.emit("operator");
    });
  }

  emit(name, detail) { this.dispatchEvent(new CustomEvent(name, { detail })); }
  on(name, listener) { this.addEventListener(name, (/** @type {CustomEvent} */ { detail }) => listener(detail)); }

  get mayOperate() { return this.you !== null && this.you === this.operator.holder; }

  /** The page has drawn for these ms: messages were queued, which is no board's silence. */
  pass(ms) { for (const board of this.boards.values()) board.quiet += Math.min(ms, DRAWN); }

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
      joint.modes = info.control[k] ?? [];
      joint.interactions = info.interaction[k] ?? [];
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

  setTargets(board, targets) {
    for (const shown of [board, ...this.partsOf(board)]) {
      for (const joint of shown.joints) {
        const k = board.joints.findIndex((other) => other.name === joint.name);
        joint.target = targets[k] ?? null;
      }
    }
  }

  setState(number, state) {
    const board = [...this.boards.values()].find((b) => b.number === number);
    if (!board) return;
    const states = state.names.map((_, k) => {
      const one = { motion_done: state.motion_done[k], rejected: state.rejected_commands[k],
        calibrated: state.calibrated[k], brake: state.brake[k] };
      for (const signal of SIGNALS) one[signal] = state[signal][k];
      return one;
    });
    const places = new Map(state.names.map((name, k) => [name, k]));
    let begun = false;
    for (const shown of [board, ...this.partsOf(board)]) {
      shown.stamp = state.stamp;
      shown.receive(performance.now());
      for (const joint of shown.joints) {
        const now = states[places.get(joint.name)];
        if (!now) continue; // its state names others than its modes do
        if (!now.motion_done && (joint.state?.motion_done ?? true)) {
          joint.target = null; // of an earlier move
          begun = true;
        }
        joint.state = now;
        joint.hasBrake ||= now.brake;
      }
      this.emit("state", shown);
    }
    if (begun) this.emit("move", board);
  }

  /** The parts of a robot's own board; none of any other board. @param {Board} whole */
  partsOf(whole) {
    if (whole.joints.length < 2) return [];
    const names = new Set(whole.joints.map((joint) => joint.name));
    const parts = [...this.boards.values()].filter((board) => board !== whole && board.space === whole.space
      && board.joints.length && board.joints.every((joint) => names.has(joint.name)));
    return parts.reduce((sum, part) => sum + part.joints.length, 0) === names.size ? parts : [];
  }

  /** The boards to watch for these: a robot's own instead of all its parts. @param {Board[]} boards */
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

  /** Boards in order: parts as in the robot, then its own board; others by name. @param {Board[]} boards */
  inOrder(boards) {
    const wholes = [...this.boards.values()].filter((board) => this.partsOf(board).length);
    const place = (board) => {
      const whole = wholes.find((other) => other.space === board.space);
      if (!whole || !board.joints.length) return board === whole ? 1e6 : 0;
      return board === whole ? 1e6 : whole.joints.findIndex((joint) => joint.name === board.joints[0].name);
    };
    return [...boards].sort((a, b) => a.space.localeCompare(b.space) || place(a) - place(b)
      || a.name.localeCompare(b.name));
  }

  /** A board's name without the common beginning of all. @param {Board} board */
  titleOf(board) {
    const one = [...this.boards.values()].every((other) => other.space === board.space);
    return one && this.boards.size > 1 ? board.name.slice(board.space.length + 1) : board.title;
  }

  /** Boards without robots' own, which repeat their parts. */
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
