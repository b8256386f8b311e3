// SPDX-License-Identifier: Apache-2.0
// @ts-check
// A question before something moves or falls. It covers nothing: STOP stays in reach.

import { button, h } from "./dom.js";

export class Questions {
  /** @param {HTMLElement} element @param {Panel} panel */
  constructor(element, panel) {
    this.element = element;
    this.panel = panel;
    this.open = null;
    element.hidden = true;
    // The key that opened the question, still held, does not answer it.
    element.addEventListener("keydown", (event) => { if (event.repeat) event.preventDefault(); });
  }

  /**
   * Ask; a promise of the answer. A question that is open is answered with no.
   * text: what will happen; yes: the word on the button; safe: whether Enter answers yes.
   */
  ask(text, yes, { safe = false } = {}) {
    this.end(false);
    return new Promise((answer) => {
      this.open = answer;
      const back = /** @type {HTMLElement} */ (document.activeElement);
      const reply = (value) => () => { this.end(value); back?.focus?.(); };
      const go = button("command primary", `${yes}: yes`, reply(true), yes);
      const no = button("", "Cancel: nothing moves", reply(false), "Cancel");
      this.element.replaceChildren(h("p", { id: "question-text" }, text), h("span", { class: "space" }), go, no);
      this.element.hidden = false;
      this.panel.permit(this.element);
      (safe ? go : no).focus();
    });
  }

  /** Answer the open question. */
  end(value) {
    const { open } = this;
    this.open = null;
    this.element.hidden = true;
    open?.(value);
  }
}
