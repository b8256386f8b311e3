// SPDX-License-Identifier: Apache-2.0
// @ts-check
// Reads a serialized BoardState: CDR, 8-byte numbers aligned to 8 bytes.

const FLOATS_BEFORE = ["position", "velocity", "torque", "position_reference",
  "velocity_reference", "torque_reference", "output", "current"];

const FLOATS_AFTER = ["motor_position", "motor_velocity", "acceleration"];
const FLOATS_LAST = ["supply_voltage", "applied", "age", "external_torque"];

const text = new TextDecoder();
const MOST = 120; // characters of a name

/** A name as shown by the server (control_board_ros/text.py): unprintable characters are replaced. */
function clean(name) {
  const letters = [...name];
  const shown = letters.slice(0, MOST).join("").replace(/[\t\n\v\f\r\x85\u2028\u2029]/g, " ")
    .replace(/[\p{Cc}\p{Cf}\p{Cs}\p{Co}\p{Cn}]/gu, "\ufffd");
  return letters.length > MOST ? `${shown} … (${letters.length - MOST} characters more)` : shown;
}

class Reader {
  constructor(buffer, start, length) {
    // Alignment counts from the end of the four bytes of the encoding.
    this.view = new DataView(buffer, start + 4, length - 4);
    this.little = (new Uint8Array(buffer)[start + 1] & 1) === 1;
    this.at = 0;
  }
  align(size) { this.at = Math.ceil(this.at / size) * size; }
  uint32() { this.align(4); const v = this.view.getUint32(this.at, this.little); this.at += 4; return v; }
  int32() { this.align(4); const v = this.view.getInt32(this.at, this.little); this.at += 4; return v; }
  /** Number of elements of a size, bytes; 0 if the message is shorter. */
  count(size) {
    const n = this.uint32();
    if (n * size > this.view.byteLength - this.at) throw new RangeError("more than the message holds");
    return n;
  }
  string() {
    const length = this.count(1);
    const bytes = new Uint8Array(this.view.buffer, this.view.byteOffset + this.at, Math.max(length - 1, 0));
    this.at += length;
    return text.decode(bytes);
  }
  strings() { return Array.from({ length: this.count(4) }, () => this.string()); }
  floats() {
    const n = this.count(8);
    const values = new Float64Array(n);
    if (n) this.align(8);
    for (let k = 0; k < n; k++, this.at += 8) values[k] = this.view.getFloat64(this.at, this.little);
    return values;
  }
  bools() {
    const n = this.count(1);
    const values = Array.from({ length: n }, (_, k) => this.view.getUint8(this.at + k) !== 0);
    this.at += n;
    return values;
  }
  counts() {
    const n = this.count(8);
    if (n) this.align(8);
    const values = new Float64Array(n);
    for (let k = 0; k < n; k++, this.at += 8) values[k] = Number(this.view.getBigUint64(this.at, this.little));
    return values;
  }
}

/** Concatenated frames of boards: number and length (4 bytes each), then the message. */
export function readFrames(buffer) {
  const view = new DataView(buffer);
  const frames = [];
  for (let at = 0; at < buffer.byteLength; at += 8 + view.getUint32(at + 4, true)) {
    const number = view.getUint32(at, true);
    try {
      frames.push({ number, state: readState(buffer, at + 8, view.getUint32(at + 4, true)) });
    } catch (error) { // one board's nonsense: the others' frames are in the same buffer
      if (!(error instanceof RangeError)) throw error;
    }
  }
  return frames;
}

/** @returns {BoardState} */
function readState(buffer, start, length) {
  const reader = new Reader(buffer, start, length);
  /** @type {any} */
  const state = { stamp: reader.int32() + 1e-9 * reader.uint32() };
  reader.string(); // frame_id
  state.names = reader.strings().map(clean);
  for (const field of FLOATS_BEFORE) state[field] = reader.floats();
  state.motion_done = reader.bools();
  state.rejected_commands = reader.counts();
  state.calibrated = reader.bools();
  state.temperature = reader.floats();
  // A board may report no motors and brakes.
  const count = state.names.length;
  for (const field of FLOATS_AFTER) {
    const values = reader.floats();
    state[field] = values.length ? values : new Float64Array(count).fill(NaN);
  }
  const brake = reader.bools();
  state.brake = brake.length ? brake : Array.from({ length: count }, () => false);
  for (const field of FLOATS_LAST) {
    const values = reader.at < reader.view.byteLength ? reader.floats() : [];
    state[field] = values.length ? values : new Float64Array(count).fill(NaN);
  }
  for (const values of Object.values(state)) {
    if (values.length !== undefined && values.length !== state.names.length)
      throw new RangeError("not one value for each joint");
  }
  return state;
}
