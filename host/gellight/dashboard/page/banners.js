// The one place for what a visitor has to know before anything else, each with what can be done about it.

import { command } from "./command.js";
import { html, nothing, render } from "./dom.js";

export class Banners {
  #box;
  #does;
  #kinds = ""; // of the watch's findings
  #hidden = ""; // those that the visitor has hidden
  #answer = ""; // to setting the zero

  /** `does`: retry(), diagnose(), resume(), show(): show all again. */
  constructor(box, does) {
    this.#box = box;
    this.#does = does;
  }

  /** Show what the watch has found, and what the state and the server's status say, the worst first. */
  show({ name }, status, undecoded) {
    const { retry, diagnose, resume } = this.#does;
    const error = name === "lost" ? "" : status?.error;
    const reload = () => location.reload();
    const open = html`<a class="link" href="calibrate.html">Open it</a>`;
    render(html`${this.#watch(status?.watch?.findings ?? [])}
      ${name !== "lost" ? nothing : banner("lost", "fault",
        "The server is gone. What is shown is what it said last.", button("Try now", retry))}
      ${error ? banner("error", "fault", error, button("Diagnostics", diagnose)) : nothing}
      ${undecoded ? banner("undecoded", "fault", undecoded, button("Reload", reload)) : nothing}
      ${name !== "calibrating" ? nothing : banner("calibrating", "warning",
        "A calibration is running. Under its light the depth means nothing.", open)}
      ${name !== "paused" ? nothing : banner("paused", "notice",
        "Paused. Drag over the chart of the indentation to see earlier frames.", button("Resume", resume))}`,
    this.#box);
  }

  /** What has changed since the calibration; nothing while the sensor is as it was calibrated. */
  #watch(findings) {
    const kinds = findings.map(({ kind, figures }) => `${kind} ${figures.led ?? ""}`).join();
    if (kinds !== this.#kinds) this.#answer = "";
    this.#kinds = kinds;
    if (kinds === "" || kinds === this.#hidden) return nothing;
    return html`<section class="banner" data-testid="watch" aria-label="changes since the calibration">
      <ul data-testid="findings">${findings.map(({ severity, text }) => html`<li class=${severity}>${text}</li>`)}</ul>
      <span class="dim" data-testid="watch-answer" role="status">${this.#answer}</span>
      <button data-testid="zero" title="nothing touches the gel: make this the zero of the depth"
        @click=${() => this.#setZero()}>Set zero</button>
      <a class="link" href="calibrate.html">Calibrate</a>
      <button data-testid="hide-watch" title="until something else is found" @click=${() => this.#hide()}>Hide</button>
    </section>`;
  }

  #hide() {
    this.#hidden = this.#kinds;
    this.#does.show();
  }

  async #setZero() {
    this.#answer = (await command({ type: "zero" })) || "the zero is set";
    this.#does.show();
  }
}

function banner(key, severity, text, action) {
  const role = severity === "fault" ? "alert" : "status";
  return html`<section class="banner ${severity}" role=${role} data-testid="banner-${key}">
    <p>${text}</p>${action}</section>`;
}

function button(text, act) {
  return html`<button @click=${act}>${text}</button>`;
}
