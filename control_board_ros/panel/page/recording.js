// SPDX-License-Identifier: Apache-2.0
// @ts-check
// Recordings of the boards shown, notes in them, and their reports.

import { button, h, redraw, setText } from "./dom.js";

/** The link of a report, which has an opaque origin. */
export const reportOf = (name) => `report/${encodeURIComponent(name)}`;

export class Recording {
  /** @param {HTMLElement} element @param {Panel} panel */
  constructor(element, panel) {
    this.element = element;
    this.panel = panel;
    /** @type {Recordings} */
    this.state = { running: "", reports: [], busy: "" };
    this.button = button("command record", "Record the boards shown", () => this.toggle());
    this.time = h("span", { class: "rate" });
    this.note = h("input", { type: "text", class: "command", placeholder: "note", maxlength: "200",
      "aria-label": "Note for the recording; Enter writes it",
      onkeydown: (event) => { if (event.key === "Enter") this.write(); } });
    this.list = h("ul", { class: "reports", "aria-label": "Reports" });
    element.replaceChildren(h("header", {}, h("h2", {}, "Recording"), this.time, this.note, this.button), this.list);
    this.draw();
  }

  tell(state) { this.state = state; this.draw(); }

  draw() {
    const { running, busy, reports, folder } = this.state;
    setText(this.button, busy || (running ? "Stop recording" : "Record"));
    this.button.setAttribute("aria-pressed", String(Boolean(running)));
    this.button.title = folder ? `into ${folder}` : "";
    this.button.dataset.idle = String(Boolean(busy));
    this.note.hidden = !running;
    redraw(this.list, "a", reports.slice(0, 5)
      .map((name) => h("li", {}, h("a", { href: reportOf(name), target: "_blank", rel: "noopener" }, name))));
    this.permit();
    this.tick();
  }

  permit() { this.panel.permit(this.element); }

  /** The duration of the recording. */
  tick() {
    const { running, since } = this.state;
    setText(this.time, running ? `${Math.max(Date.now() / 1000 - since, 0).toFixed(0)} s` : "");
  }

  async toggle() {
    const on = !this.state.running;
    const boards = this.panel.model.sources(this.panel.shownBoards()).map((board) => board.name);
    const answer = await this.panel.request("record", on ? { on, boards } : { on });
    if (answer.ok && answer.report) this.open(answer.report);
  }

  /** Open a report; its link remains if the browser blocks the window. */
  open(name) { window.open(reportOf(name), "_blank", "noopener"); }

  async write() {
    const text = this.note.value.trim();
    if (text && (await this.panel.request("note", { text })).ok) this.note.value = "";
  }
}
