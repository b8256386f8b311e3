// SPDX-License-Identifier: Apache-2.0
// @ts-check
// Creates elements. Text is always set as text: names are of other machines.

/**
 * An element: h("button", {class: "a", onclick: f, "aria-label": "b"}, "text", child).
 * @template {keyof HTMLElementTagNameMap} T @param {T} tag @returns {HTMLElementTagNameMap[T]}
 */
export function h(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "text") element.textContent = value;
    else if (name in element && typeof value !== "string") element[name] = value;
    else element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

/**
 * A button. Its label names it to screen readers where its content does not.
 * @param {string} kind @param {string | null} label @param {(() => unknown) | null} onclick
 * @param {string | Node} content @param {Record<string, string>} more
 */
export function button(kind, label, onclick, content = "", more = {}) {
  return h("button", { type: "button", class: kind || null, "aria-label": label, onclick, ...more }, content);
}

const SHAPES = {
  chevron: "M6 9l6 6 6-6", copy: "M9 9h10v11H9zM5 15V4h10", close: "M6 6l12 12M18 6L6 18",
  plot: "M4 4v16h16M7 15l4-5 3 3 5-7",
  hand: "M8 12V6a2 2 0 0 1 4 0v5-6a2 2 0 0 1 4 0v7-4a2 2 0 0 1 4 0v6a7 7 0 0 1-7 7h-1c-3 0-5-2-8-7a2 2 0 0 1 3-2z",
  pause: "M8 5v14M16 5v14", play: "M8 5l11 7-11 7z", moon: "M20 14a8 8 0 1 1-9-10 6 6 0 0 0 9 10z",
  sun: "M12 8a4 4 0 1 0 0 8 4 4 0 0 0 0-8zM12 2v2M12 20v2M2 12h2M20 12h2M5 5l1.5 1.5M17.5 17.5L19 19M5 19l1.5-1.5M17.5 6.5L19 5",
  left: "M15 6l-6 6 6 6", right: "M9 6l6 6-6 6", fit: "M4 9V4h5M20 9V4h-5M4 15v5h5M20 15v5h-5",
  ghost: "M5 12a7 7 0 0 1 14 0v8l-3-2-2 2-2-2-2 2-2-2-3 2z",
};

/** An icon, hidden from screen readers. */
export function icon(name) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("viewBox", "0 0 24 24");
  svg.setAttribute("class", "icon");
  svg.setAttribute("aria-hidden", "true");
  const path = document.createElementNS("http://www.w3.org/2000/svg", "path");
  path.setAttribute("d", SHAPES[name]);
  svg.append(path);
  return svg;
}

/** Replace the children; a keyboard focus among them moves to the chosen one. */
export function redraw(element, chosen, children) {
  const inside = element.contains(document.activeElement);
  element.replaceChildren(...children);
  if (inside) element.querySelector(chosen)?.focus();
}

/** A choice as one control: radio buttons that look like a bar. */
export function segmented(element, label, options, chosen, choose) {
  redraw(element, "[aria-checked=true]", Object.entries(options).map(([value, text]) => button(
    "", `${label}: ${text}`, () => choose(value), text, { role: "radio", "aria-checked": String(value === chosen) })));
  return element;
}

/**
 * A menu that acts by the mouse or by Enter. Arrow keys and letters only browse; left without
 * Enter, it shows the value in force again.
 */
export function chooseOnce(select, choose, current) {
  let walking = false;
  const leave = () => {
    walking = false;
    select.classList.remove("walking");
    select.value = current();
  };
  select.addEventListener("pointerdown", () => { walking = false; });
  select.addEventListener("keydown", (event) => {
    if (event.key === "Enter" && walking) {
      event.preventDefault();
      const { value } = select;
      walking = false;
      select.classList.remove("walking");
      if (value !== current()) choose(value);
    } else if (event.key.startsWith("Arrow") || ["Home", "End", "PageUp", "PageDown"].includes(event.key)
      || event.key.length === 1) walking = true;
  });
  select.addEventListener("change", () => {
    if (walking) select.classList.add("walking");
    else choose(select.value);
  });
  select.addEventListener("blur", () => { if (walking) leave(); });
}

/** Set a text only if it differs. @param {HTMLElement & {shown?: string}} element */
export function setText(element, text) {
  if (element.shown !== text) { element.shown = text; element.textContent = text; }
}

let hiding = 0;
export function toast(text, bad = false, loud = false) {
  const element = document.getElementById("toast");
  element.textContent = text;
  element.className = `toast shown${bad ? " bad" : ""}${loud ? " loud" : ""}`;
  element.setAttribute("role", loud ? "alert" : "status");
  clearTimeout(hiding);
  hiding = setTimeout(() => { element.className = "toast"; }, bad ? 7000 : 3000);
}

/** Offer a text as a file. */
export function download(name, content, type) {
  const address = content instanceof Blob ? URL.createObjectURL(content)
    : URL.createObjectURL(new Blob([content], { type }));
  h("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 1000);
}
