// SPDX-License-Identifier: Apache-2.0
// @ts-check
// Dark or light: as the system, also after its changes, or as chosen.

import { icon } from "./dom.js";

const light = matchMedia("(prefers-color-scheme: light)");

/** Apply the theme now and after each change; the button chooses the other one. */
export function followTheme(button, changed) {
  const draw = () => {
    const system = light.matches ? "light" : "dark";
    const theme = localStorage.getItem("theme") ?? system;
    const other = theme === "dark" ? "light" : "dark";
    document.documentElement.dataset.theme = theme;
    button.replaceChildren(icon(theme === "dark" ? "sun" : "moon"));
    button.setAttribute("aria-label", other === "light" ? "Light colours" : "Dark colours");
    button.onclick = () => {
      if (other === system) localStorage.removeItem("theme");
      else localStorage.setItem("theme", other);
      draw();
    };
    changed();
  };
  light.addEventListener("change", draw);
  draw();
}
