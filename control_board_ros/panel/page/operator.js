// SPDX-License-Identifier: Apache-2.0
// @ts-check
// The operator: shown, requested, answered.

import { button, h } from "./dom.js";

export class Operator {
  /** @param {HTMLElement} element @param {Panel} panel */
  constructor(element, panel) {
    this.element = element;
    this.panel = panel;
  }

  draw() {
    const { model } = this.panel;
    const { holder, asking, browsers } = model.operator;
    const ask = (text, what, label) => button("small-button", label, () => this.panel.request(what, {}), text);
    const parts = [];
    if (model.you === null) parts.push(h("span", { class: "who off" }, "No connection"));
    else if (model.readOnly) parts.push(h("span", { class: "who" }, "Read-only"));
    else if (holder === model.you)
      parts.push(h("span", { class: "who you" }, "You operate"),
        ask("Step back", "step_back", "Step back: let others operate"));
    else if (holder === null)
      parts.push(h("span", { class: "who" }, "No operator"), ask("Operate", "operate", "Operate"));
    else if (asking === model.you)
      parts.push(h("span", { class: "who" }, `Asking ${browsers[holder] ?? "the operator"} …`));
    else parts.push(h("span", { class: "who" }, `${browsers[holder] ?? "Another browser"} operates`),
      ask("Take over", "operate", "Ask to take over"));
    const key = JSON.stringify([model.you, model.readOnly, holder, asking, browsers]);
    if (key === this.shown) return;
    this.shown = key;
    this.element.replaceChildren(...parts);
  }
}
