// SPDX-License-Identifier: Apache-2.0
// @ts-check
// The WebSocket: requests with numbers and their answers, messages, frames; reconnects by itself.

import { readFrames } from "./cdr.js";

const AGAIN = 1000; // ms until the next try

/** Names this tab, also after a reload: whoever operates goes on. */
function tab() {
  if (!sessionStorage.tab) sessionStorage.tab = String(Math.random()).slice(2);
  return sessionStorage.tab;
}

export class Connection extends EventTarget {
  constructor() {
    super();
    this.open = false;
    this.next = 1;
    this.waiting = new Map();
    this.connect();
  }

  connect() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const base = location.pathname.replace(/[^/]*$/, "");
    this.socket = new WebSocket(`${scheme}://${location.host}${base}ws?tab=${tab()}`);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => { this.open = true; this.emit("open"); };
    this.socket.onclose = (event) => {
      this.open = false;
      for (const { done } of this.waiting.values()) done({ ok: false, message: "the connection is gone" });
      this.waiting.clear();
      this.emit("closed", { reason: event.reason });
      setTimeout(() => this.connect(), AGAIN);
    };
    this.socket.onmessage = ({ data }) => {
      if (data instanceof ArrayBuffer) for (const frame of readFrames(data)) this.emit("frame", frame);
      else this.receive(JSON.parse(data));
    };
  }

  emit(name, detail = {}) { this.dispatchEvent(new CustomEvent(name, { detail })); }

  on(name, listener) { this.addEventListener(name, (/** @type {CustomEvent} */ { detail }) => listener(detail)); }

  receive(message) {
    const asked = this.waiting.get(message.id);
    if (message.is === "answer" && asked) {
      this.waiting.delete(message.id);
      asked.done(message);
    } else if (message.is === "progress" && asked) {
      asked.progress?.(message);
    }
    this.emit(message.is, message);
  }

  /** Send a request; returns a promise of its answer, with the request's id. @returns {Asked} */
  ask(what, fields = {}, progress = null) {
    const id = this.next++;
    const answer = new Promise((done) => {
      if (!this.open) { done({ ok: false, message: "no connection to the panel's server" }); return; }
      this.waiting.set(id, { done, progress });
      this.socket.send(JSON.stringify({ id, do: what, ...fields }));
    });
    return Object.assign(answer, { id });
  }
}
