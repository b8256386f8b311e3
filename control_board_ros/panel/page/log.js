// SPDX-License-Identifier: Apache-2.0
// @ts-check
// The log of actions: by whom, as lines to copy.

import { button, h, icon, segmented, toast } from "./dom.js";

const MOST = 500;
const WORLDS = { cbctl: "cbctl", ros2: "ros2", python: "Python" };

async function copy(text) {
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    // Without https, pages of other machines have no clipboard API.
    const area = h("textarea", { class: "offscreen", "aria-hidden": "true" });
    area.value = text;
    document.body.append(area);
    area.select();
    document.execCommand("copy");
    area.remove();
  }
  toast("Copied");
}


/** The lines of successful entries, oldest first, as a program of the world. */
function script(entries, world) {
  const done = entries.filter((entry) => entry.lines?.[world] && entry.ok !== false);
  const board = (name) => `board = ControlBoardClient(node, ${JSON.stringify(name)})`;
  const lines = [];
  let before = null;
  for (const { at, board: of, lines: { [world]: line } } of done) {
    if (world === "python" && of && of !== before) lines.push(board(of));
    before = of || before;
    lines.push(world === "python" ? `${line}  # ${clock(at)}` : `# ${clock(at)}`,
      ...(world === "python" ? [] : [line]));
  }
  const head = world === "python"
    ? ["import rclpy", "from control_board_ros.client import ControlBoardClient", "", "rclpy.init()",
      'node = rclpy.create_node("script")'] : ["#!/bin/sh", "set -e"];
  return [...head, ...lines, ""].join("\n");
}

const clock = (at) => new Date(1000 * at).toTimeString().slice(0, 8);

export class Log {
  /** @param {HTMLElement} element @param {Panel} panel */
  constructor(element, panel) {
    this.panel = panel;
    this.world = localStorage.getItem("world") ?? "cbctl";
    this.entries = [];
    this.choice = h("div", { class: "segmented small", role: "radiogroup", "aria-label": "Lines as" });
    this.list = h("ol", { class: "entries", tabindex: "0", "aria-label": "Commands, newest first" });
    this.all = button("small-button", "Copy all as a script",
      () => copy(script([...this.entries].reverse(), this.world)), "Copy all",
      { title: "What was done, oldest first, as a script" });
    element.replaceChildren(h("header", {}, h("h2", {}, "Commands"), this.choice, this.all), this.list);
    this.draw();
  }

  draw() {
    segmented(this.choice, "Lines as", WORLDS, this.world, (world) => {
      this.world = world;
      localStorage.setItem("world", world);
      this.draw();
    });
    this.list.replaceChildren(...this.entries.map((entry) => this.row(entry)));
    this.all.disabled = !this.entries.length;
    if (!this.entries.length)
      this.list.replaceChildren(h("li", { class: "hint" }, "Everything that is done shows here, as lines to copy."));
  }

  /** Entries before this page was opened. */
  begin(entries) {
    this.entries = [];
    for (const entry of entries) this.take(entry);
    this.draw();
  }

  add(entry) {
    if (!this.entries.length) this.list.replaceChildren();
    if (this.take(entry)) this.list.firstElementChild?.remove();
    this.list.prepend(this.row(entry));
    while (this.list.children.length > MOST) this.list.lastElementChild.remove();
    this.all.disabled = false;
  }

  /** Keep an entry; returns whether it replaces the one before: positions of one slider, sent live. */
  take(entry) {
    const last = this.entries[0];
    const again = last && entry.live && last.live && entry.ok && last.ok && last.what === entry.what
      && last.by === entry.by && last.board === entry.board
        && last.lines?.cbctl.split("=")[0] === entry.lines?.cbctl.split("=")[0];
    entry.times = again ? last.times + 1 : 1;
    if (again) this.entries.shift();
    this.entries.unshift(entry);
    this.entries.length = Math.min(this.entries.length, MOST);
    return again;
  }

  row({ at, who, what, by, lines, ok, message, times }) {
    const line = what === "stop" && !message ? "" : lines?.[this.world];
    const mine = by !== undefined && by === this.panel.model.you;
    const from = mine ? "" : who;
    const result = ok === undefined ? null : ok
      ? h("span", { class: "result", title: message || "accepted" }, times > 1 ? `✓ ×${times}` : "✓")
      : h("span", { class: "result bad" }, "refused");
    return h("li", { class: `entry${ok === false ? " bad" : ""}${by === undefined ? " elsewhere" : ""}` },
      h("time", {}, clock(at)), h("span", { class: "words", title: line || what },
        from ? h("span", { class: "from" }, `${from} `) : null,
        line ? h("code", {}, line) : what === "stop" ? "STOP: every joint of every board" : what), result,
      line ? button("ghost", `Copy: ${line}`, () => copy(line), icon("copy")) : null,
      message && ok === false ? h("span", { class: "reason" }, message) : null);
  }
}
