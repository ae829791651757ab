// The keys of the page: every element with a `data-key` is clicked by it, and the help lists them.

import { element, html, render } from "./dom.js";
import { onKey } from "./hand.js";

const MORE_KEYS = [
  ["arrows", "on a picture: move the cursor; with Shift by 0.1 mm"],
  ["Enter", "on a picture: press there, or begin and end the line to measure"],
  ["arrows, + −", "on the surface: turn it, come nearer"],
  ["arrows", "on the chart of the indentation: earlier and later frames"],
  ["Esc", "close what is open, then clear the line, then end measuring"],
];

/** Listen to the keys; `escape()` is called for Esc. */
export function listenToKeys(escape) {
  const keyed = new Map([...document.querySelectorAll("[data-key]")].map((node) => [node.dataset.key, node]));
  onKey(document, ({ key, target }) => {
    if (target.closest("input:not([type=radio]), select")) return false;
    if (key === "Escape" && !document.querySelector(":popover-open") && !document.fullscreenElement) escape();
    const node = keyed.get(key.toLowerCase());
    if (!node || (key === " " && target.closest("button, input, a, summary"))) return false;
    return node.click();
  });
  fillHelp(keyed);
}

function fillHelp(keyed) {
  const own = [...keyed].map(([key, { title, textContent }]) => {
    const name = textContent.trim();
    return [key === " " ? "Space" : key.toUpperCase(), title ? `${name}: ${title}` : name];
  });
  const line = ([key, text]) => html`<div><dt><kbd>${key}</kbd></dt><dd>${text}</dd></div>`;
  render([...own, ...MORE_KEYS].map(line), element("keys"));
}

/** Make `button` enter and leave full screen. */
export function offerFullScreen(button) {
  button.hidden = !document.fullscreenEnabled;
  button.addEventListener("click", () => {
    if (document.fullscreenElement) document.exitFullscreen();
    else document.documentElement.requestFullscreen();
  });
  document.addEventListener("fullscreenchange", () => {
    button.setAttribute("aria-pressed", Boolean(document.fullscreenElement));
  });
}
