// SPDX-License-Identifier: Apache-2.0
// @ts-check
// The operator: shown, requested, answered.

import { h } from "./dom.js";

export class Operator {
  /** @param {HTMLElement} element @param {Panel} panel */
  constructor(element, panel) {
    this.element = element;
    this.panel = panel;
  }

  draw() {
    const { model } = this.panel;
    const { holder, asking, browsers } = model.operator;
    const button = (text, what, label) =>
      h("button", { type: "button", class: "small-button", "aria-label": label,
        onclick: () => this.panel.request(what, {}) }, text);
    const parts = [];
    if (model.you === null) parts.push(h("span", { class: "who off" }, "No connection"));
    else if (model.readOnly) parts.push(h("span", { class: "who" }, "Read-only"));
    else if (holder === model.you)
      parts.push(h("span", { class: "who you" }, "You operate"),
        button("Step back", "step_back", "Step back: let others operate"));
    else if (holder === null)
      parts.push(h("span", { class: "who" }, "No operator"), button("Operate", "operate", "Operate"));
    else if (asking === model.you)
      parts.push(h("span", { class: "who" }, `Asking ${browsers[holder] ?? "the operator"} …`));
    else parts.push(h("span", { class: "who" }, `${browsers[holder] ?? "Another browser"} operates`),
      button("Take over", "operate", "Ask to take over"));
    const key = JSON.stringify([model.you, model.readOnly, holder, asking, browsers]);
    if (key === this.shown) return;
    this.shown = key;
    this.element.replaceChildren(...parts);
  }
}
