// SPDX-License-Identifier: Apache-2.0
// @ts-check
// Layout of joints: cards, a table with a line for each, or a phone's list with one open.

import { h, segmented } from "./dom.js";

const MANY = 10; // joints above which they are a table, unless chosen otherwise
const VIEWS = { cards: "Cards", table: "Table" };
const HEADS = ["Joint", "Mode", "Interaction", "Position", "Target", "", "Velocity", "Torque", "Temp.", "State", ""];
const narrow = matchMedia("(max-width: 700px)");

export class Layout {
  /** @param {Panel} panel @param {HTMLElement} element */
  constructor(panel, element) {
    this.panel = panel;
    this.element = element;
    this.choice = h("div", { class: "segmented small views", role: "radiogroup", "aria-label": "Joints as" });
    this.heads = h("div", { class: "table-head", "aria-hidden": "true" }, ...HEADS.map((text) => h("span", {}, text)));
    narrow.addEventListener("change", () => this.draw());
  }

  get kept() { return this.panel.cards.length > MANY ? "view of many" : "view"; }

  /** The layout, chosen or fitting: cards, table or list. */
  get view() {
    if (narrow.matches) return "list";
    return localStorage.getItem(this.kept) ?? (this.panel.cards.length > MANY ? "table" : "cards");
  }

  draw() {
    const { view } = this;
    for (const name of ["cards", "table", "list"]) this.element.classList.toggle(`as-${name}`, name === view);
    if (view === "table") this.element.prepend(this.heads);
    else this.heads.remove();
    document.querySelector(view === "table" ? ".right" : ".left").append(document.getElementById("log"));
    this.choice.hidden = view === "list";
    segmented(this.choice, "Joints as", VIEWS, view, (chosen) => {
      localStorage.setItem(this.kept, chosen);
      this.draw();
    });
  }

  /** Open a joint; in a list, close the others. @param {Card} card */
  opened(card) {
    if (this.view === "list") for (const other of this.panel.cards) if (other !== card) other.expand(false);
  }
}
