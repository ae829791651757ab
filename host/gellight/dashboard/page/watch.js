// What the watch has found: shown above the pictures, hidden while the sensor is as it was calibrated.

import { command } from "./command.js";
import { element, node } from "./dom.js";

export class WatchNotice {
  #hidden = ""; // the findings that the visitor has hidden
  #shown = "";
  #texts = ""; // of the findings that are shown

  constructor() {
    element("zero").addEventListener("click", () => this.#setZero());
    element("hide-watch").addEventListener("click", () => {
      this.#hidden = this.#shown;
      element("watch").hidden = true;
    });
  }

  /** Show what the status says of the watch; null where the sensor is not watched. */
  show(watch) {
    const findings = watch?.findings ?? [];
    const kinds = findings.map(({ kind, figures }) => `${kind} ${figures.led ?? ""}`).join();
    element("watch").hidden = findings.length === 0 || kinds === this.#hidden;
    const texts = findings.map(({ text }) => text).join();
    if (kinds !== this.#shown) element("watch-answer").textContent = "";
    this.#shown = kinds;
    if (texts === this.#texts) return;
    this.#texts = texts;
    element("findings").replaceChildren(...findings.map(({ severity, text }) => node("li", text, severity)));
  }

  async #setZero() {
    element("watch-answer").textContent = (await command({ type: "zero" })) || "the zero is set";
  }
}
