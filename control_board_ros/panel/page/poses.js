// SPDX-License-Identifier: Apache-2.0
// @ts-check
// Named poses of a board: go, save, and sequences of them.

import { button, download, h, toast } from "./dom.js";
import { parse } from "./units.js";

export class Poses {
  /** @param {HTMLElement} element @param {Panel} panel */
  constructor(element, panel) {
    this.element = element;
    this.panel = panel;
    this.steps = [];
    this.running = this.asked = null;
    this.offered = false;
    this.name = h("input", { type: "text", class: "command", placeholder: "name",
      "aria-label": "Name of the pose to save", maxlength: "60" });
    const save = button("command", "Save the joints as they are as a pose", () => this.save(), "Save as");
    this.list = h("div", { class: "pose-list" });
    this.shownSequence = this.sequence();
    element.replaceChildren(h("header", {}, h("h2", {}, "Poses"), h("span", { class: "space" }), this.name, save),
      this.list, this.shownSequence);
    element.hidden = true;
  }

  /** The board shown; for all joints, the robot's own node if any. */
  get board() {
    const shown = this.panel.shownBoards();
    if (shown.length === 1) return shown[0];
    const { model } = this.panel;
    return [...model.boards.values()].find((board) => !model.parts.includes(board));
  }

  /** Begin with the board shown. */
  load() {
    this.end();
    const { board } = this;
    this.offered = false;
    this.element.hidden = true;
    if (!board) return;
    this.steps = JSON.parse(localStorage.getItem(`sequence ${board.name}`) ?? "[]");
    this.draw();
    this.refresh();
  }

  /** Ask for the poses as they are now; what is typed stays. */
  async refresh() {
    const { board } = this;
    if (!board) return;
    const asked = this.panel.ask("poses", { board: board.name });
    this.asked = asked;
    const answer = await asked;
    if (asked !== this.asked || board !== this.board || !answer.ok) return; // asked again since: as shown
    this.offered = true;
    this.element.hidden = false;
    this.drawList(answer.poses);
  }

  permit() { if (this.offered) this.panel.permit(this.element); }

  drawList(poses) {
    const go = (pose) => this.panel.request("pose", { board: this.board.name, pose });
    this.list.replaceChildren(...poses.map((pose) => h("span", { class: "pose" },
      button("command", `Go to ${pose}`, () => go(pose), pose),
      button("ghost", `Add ${pose} to the sequence`, () => this.addStep(pose), "+"))));
    this.permit();
  }

  /** Draw the sequence. */
  draw() {
    const sequence = this.sequence();
    this.shownSequence.replaceWith(sequence);
    this.shownSequence = sequence;
    this.permit();
  }

  sequence() {
    const rows = this.steps.map((step, k) => {
      const speed = h("input", { type: "text", class: "number", "aria-label": `Step ${k + 1}: speed, or time with s`,
        placeholder: "pose's own",
        onchange: (event) => { step.how = event.target.value.trim(); this.keep(); } });
      speed.value = step.how;
      return h("li", { class: this.running?.at === k ? "now" : "" }, h("span", {}, step.pose), speed,
        button("ghost", `Remove step ${k + 1}`,
          () => { this.steps.splice(k, 1); this.keep(); this.draw(); }, "×"));
    });
    const running = this.running !== null;
    return h("details", { class: "sequence", open: this.steps.length > 0 }, h("summary", {}, "Sequence"),
      this.steps.length ? h("ol", {}, ...rows)
        : h("p", { class: "hint" }, "Add poses with +. Each step may have a speed (20deg/s) or a time (3s)."),
      h("div", { class: "buttons" },
        running ? button("primary", "End the sequence", () => this.end(), "End")
          : button("command primary", "Run the sequence once", () => this.run(false), "Run"),
        running ? null : button("command", "Run the sequence again and again", () => this.run(true), "Cycle"),
        button("", "Save the sequence to a file",
          () => download("sequence.json", JSON.stringify(this.steps, null, 1), "application/json"), "Save file"),
        button("", "Load a sequence from a file", () => this.loadFile(), "Load file")));
  }

  addStep(pose) { this.steps.push({ pose, how: "" }); this.keep(); this.draw(); }

  keep() { localStorage.setItem(`sequence ${this.board.name}`, JSON.stringify(this.steps)); }

  loadFile() {
    const input = h("input", { type: "file", accept: "application/json" });
    input.addEventListener("change", async () => {
      try {
        const steps = JSON.parse(await input.files[0].text());
        if (!Array.isArray(steps) || steps.some((s) => typeof s.pose !== "string" || typeof s.how !== "string"))
          throw new Error("it is no sequence");
        this.steps = steps.slice(0, 100).map(({ pose, how }) => ({ pose, how }));
        this.keep();
        this.draw();
      } catch (error) { toast(`The file was not loaded: ${error.message}`, true); }
    });
    input.click();
  }

  async save() {
    const pose = this.name.value.trim();
    if (!pose) { toast("Give the pose a name first.", true); return; }
    const answer = await this.panel.request("save_pose", { board: this.board.name, pose });
    if (answer.ok) { this.name.value = ""; toast(`Saved as ${pose}.`); }
  }

  async run(again) {
    const board = this.board.name;
    const running = { at: 0, request: null };
    this.running = running;
    do {
      for (running.at = 0; running.at < this.steps.length && this.running === running; running.at++) {
        this.draw();
        const asked = await this.step(board, this.steps[running.at], running);
        if (!asked.ok) { again = false; break; }
      }
    } while (again && this.running === running && this.steps.length);
    if (this.running === running) this.running = null;
    this.draw();
  }

  /** One step: at the pose's own speed, at a speed, or with a duration. */
  async step(board, { pose, how }, running) {
    const time = /^([\d.]+)\s*s$/.exec(how);
    let asked;
    if (time) {
      const found = await this.panel.ask("poses", { board, pose });
      if (!found.ok) { toast(found.message, true); return found; }
      const joints = new Map(this.panel.cards.map(({ joint }) => [joint.name, joint]));
      const ways = found.names.map((name, k) =>
        Math.abs(found.positions[k] - (joints.get(name)?.state?.position ?? 0)));
      const speeds = ways.map((way) => Math.max(way / Number(time[1]), 1e-3));
      asked = this.panel.request("move", { board, joints: found.names, positions: found.positions, speeds });
    } else {
      const speed = how ? parse(how, "velocity", false) : null;
      if (how && !(speed > 0)) {
        toast(`${how} is neither a speed (20deg/s) nor a time (3s)`, true);
        return { ok: false };
      }
      asked = this.panel.request("pose", { board, pose, ...(speed ? { speed } : {}) });
    }
    running.request = asked.id;
    return asked;
  }

  end() {
    const { running } = this;
    if (!running) return;
    this.running = null;
    if (running.request !== null) this.panel.ask("cancel", { request: running.request });
    this.draw();
  }
}
