// SPDX-License-Identifier: Apache-2.0
// Reads a BoardState as it came over the wire: CDR, 8-byte numbers aligned to 8 bytes.

const FLOATS_BEFORE = ["position", "velocity", "torque", "position_reference",
  "velocity_reference", "torque_reference", "output", "current"];

const text = new TextDecoder();

class Reader {
  constructor(buffer, start) {
    // Alignment counts from behind the four bytes that tell the encoding.
    this.view = new DataView(buffer, start + 4);
    this.little = (new Uint8Array(buffer)[start + 1] & 1) === 1;
    this.at = 0;
  }
  align(size) { this.at = Math.ceil(this.at / size) * size; }
  uint32() { this.align(4); const v = this.view.getUint32(this.at, this.little); this.at += 4; return v; }
  int32() { this.align(4); const v = this.view.getInt32(this.at, this.little); this.at += 4; return v; }
  string() {
    const length = this.uint32();
    const bytes = new Uint8Array(this.view.buffer, this.view.byteOffset + this.at, length - 1);
    this.at += length;
    return text.decode(bytes);
  }
  strings() { return Array.from({ length: this.uint32() }, () => this.string()); }
  floats() {
    const n = this.uint32();
    const values = new Float64Array(n);
    if (n) this.align(8);
    for (let k = 0; k < n; k++, this.at += 8) values[k] = this.view.getFloat64(this.at, this.little);
    return values;
  }
  bools() {
    const n = this.uint32();
    const values = Array.from({ length: n }, (_, k) => this.view.getUint8(this.at + k) !== 0);
    this.at += n;
    return values;
  }
  counts() {
    const n = this.uint32();
    if (n) this.align(8);
    const values = new Float64Array(n);
    for (let k = 0; k < n; k++, this.at += 8) values[k] = Number(this.view.getBigUint64(this.at, this.little));
    return values;
  }
}

/** Frames of boards, one behind the other: number and length (4 bytes each), then the message. */
export function readFrames(buffer) {
  const view = new DataView(buffer);
  const frames = [];
  for (let at = 0; at < buffer.byteLength; at += 8 + view.getUint32(at + 4, true)) {
    frames.push({ number: view.getUint32(at, true), state: readState(buffer, at + 8) });
  }
  return frames;
}

function readState(buffer, start) {
  const reader = new Reader(buffer, start);
  const state = { stamp: reader.int32() + 1e-9 * reader.uint32() };
  reader.string(); // frame_id
  state.names = reader.strings();
  for (const field of FLOATS_BEFORE) state[field] = reader.floats();
  state.motion_done = reader.bools();
  state.rejected_commands = reader.counts();
  state.calibrated = reader.bools();
  state.temperature = reader.floats();
  return state;
}
