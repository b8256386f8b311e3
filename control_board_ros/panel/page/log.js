// SPDX-License-Identifier: Apache-2.0
// What was done, by whom, as lines to copy.

import { h, icon, segmented, toast } from "./dom.js";

const MOST = 200;
const WORLDS = { cbctl: "cbctl", ros2: "ros2", python: "Python" };

async function copy(text) {
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    // Without https, browsers of other machines have no clipboard for pages: the old way.
    const area = h("textarea", { class: "offscreen", "aria-hidden": "true" });
    area.value = text;
    document.body.append(area);
    area.select();
    document.execCommand("copy");
    area.remove();
  }
  toast("Copied");
}

export class Log {
  constructor(element, panel) {
    this.panel = panel;
    this.world = localStorage.getItem("world") ?? "cbctl";
    this.entries = [];
    this.choice = h("div", { class: "segmented small", role: "radiogroup", "aria-label": "Lines as" });
    this.list = h("ol", { class: "entries", tabindex: "0", "aria-label": "Commands, newest first" });
    element.replaceChildren(h("header", {}, h("h2", {}, "Commands"), this.choice), this.list);
    this.draw();
  }

  draw() {
    segmented(this.choice, "Lines as", WORLDS, this.world, (world) => {
      this.world = world;
      localStorage.setItem("world", world);
      this.draw();
    });
    this.list.replaceChildren(...this.entries.map((entry) => this.row(entry)));
    if (!this.entries.length) this.list.replaceChildren(h("li", { class: "hint" }, "Everything that is done shows here, as lines to copy."));
  }

  add(entry) {
    entry.time = new Date().toTimeString().slice(0, 8);
    const last = this.entries[0];
    const again = last && last.what === entry.what && last.by === entry.by && last.board === entry.board && last.who === entry.who
      && (!entry.lines || last.lines?.cbctl.split("=")[0] === entry.lines.cbctl.split("=")[0]);
    if (again && ["position", "direct", "hold"].includes(entry.what)) this.entries.shift();
    this.entries.unshift(entry);
    this.entries.length = Math.min(this.entries.length, MOST);
    this.draw();
  }

  row({ time, who, what, by, lines, ok, message }) {
    const line = lines?.[this.world];
    const mine = by !== undefined && by === this.panel.model.you;
    const from = mine ? "" : who;
    return h("li", { class: `entry${ok === false ? " bad" : ""}${by === undefined ? " elsewhere" : ""}` },
      h("time", {}, time), from ? h("span", { class: "from" }, from) : null,
      line ? h("code", {}, line) : h("span", {}, what === "stop" ? "STOP: every joint of every board" : what),
      line ? h("button", { type: "button", class: "ghost", "aria-label": `Copy: ${line}`, onclick: () => copy(line) }, icon("copy")) : null,
      message && ok === false ? h("span", { class: "reason" }, message) : null);
  }
}
