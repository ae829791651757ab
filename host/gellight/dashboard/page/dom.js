// Elements of the page: found, written, and made by lit-html of what is to be shown.

export { html, nothing, render, svg } from "./vendor/lit-html-3.3/lit-html.js";
export { repeat } from "./vendor/lit-html-3.3/directives/repeat.js";

export const element = (id) => document.getElementById(id);

/** Write `text`, if it is another one: the page is laid out anew after every change. */
export function write(id, text) {
  if (element(id).textContent !== text) element(id).textContent = text;
}
