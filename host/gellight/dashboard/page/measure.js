// Measuring: what is under the pointer, and the section along a line drawn over a picture.

import { element, write } from "./dom.js";
import { along, depthAt, sectionOf, slopeDegAt } from "./field.js";
import { fixed } from "./figures.js";
import { plot, roundUp } from "./plot.js";

const SHORTEST_MM = 0.3; // a shorter line is a click
const LEAST_SCALE_MM = 0.05;
const LINE_POINTS = 100;
const ADVICE = "Press Measure and draw a line over any picture.";

export class Measure {
  line = null; // [start, end], each [x, y] in mm
  point = null; // under the pointer or the cursor of the arrow keys
  section = null; // {measured, truth}: see sectionOf
  #start = null; // where a line was begun
  #view = null;
  #changed;

  /** `changed()` is called when line or point have changed. */
  constructor(changed) {
    this.#changed = changed;
    element("clear-line").addEventListener("click", () => this.clear());
    new ResizeObserver(() => this.#draw()).observe(element("section"));
  }

  /** Measure another view. */
  show(view) {
    this.#view = view;
    this.#read();
    if (this.line) this.#cut();
  }

  /** Places along the line, for drawing it on the surface. */
  get places() {
    return this.line ? along(this.line, LINE_POINTS) : [];
  }

  pointAt(place) {
    this.point = place;
    this.#read();
    this.#changed();
  }

  down(place) {
    this.#start = place;
  }

  move(place) {
    if (this.#start) this.#setLine([this.#start, place]);
  }

  up() {
    this.#start = null;
  }

  /** Begin a line with the arrow keys' cursor, or end it. */
  enter(place) {
    if (this.#start) {
      this.#setLine([this.#start, place]);
      this.#start = null;
    } else this.#start = place;
  }

  clear() {
    this.line = this.#start = this.section = null;
    this.#cut();
    this.#changed();
  }

  #setLine([start, end]) {
    if (Math.hypot(end[0] - start[0], end[1] - start[1]) < SHORTEST_MM) return;
    this.line = [start, end];
    this.#cut();
    this.#changed();
  }

  #read() {
    const [view, place] = [this.#view, this.point];
    if (!view || !place) return write("readout", "point at a picture to measure");
    const [x, y] = place.map((mm) => fixed(mm, 2));
    const depth = (name, codes) => `${name} ${fixed(depthAt(view, codes, place), 3)} mm`;
    const depths = [depth("depth", view.depth), ...(view.truth ? [depth("true", view.truth)] : [])];
    write("readout", [`x ${x} y ${y} mm`, ...depths, `slope ${fixed(slopeDegAt(view, place), 1)}°`].join(" · "));
  }

  #cut() {
    element("clear-line").hidden = !this.line;
    if (!this.line || !this.#view) write("section-text", ADVICE);
    else {
      const { depth, truth } = this.#view;
      const cut = (codes) => codes && sectionOf(this.#view, codes, this.line);
      this.section = { measured: cut(depth), truth: cut(truth) };
      write("section-text", describe(this.section));
    }
    this.#draw();
  }

  #draw() {
    const { measured, truth } = this.section ?? { measured: [], truth: null };
    const depths = [...measured, ...(truth ?? [])].map(([, mm]) => mm).filter((mm) => mm !== null);
    const lowest = Math.min(0, ...depths);
    const top = roundUp(Math.max(LEAST_SCALE_MM, ...depths));
    plot(element("section"), {
      x: { from: 0, to: measured.at(-1)?.[0] ?? 10, label: "mm along the line" },
      y: { from: lowest < -0.02 * top ? -roundUp(-lowest) : 0, to: top, label: "mm" },
      curves: [{ points: measured, filled: true }, ...(truth ? [{ points: truth, dashed: true }] : [])],
    });
  }
}

function describe({ measured, truth }) {
  const deepest = (points) => fixed(Math.max(...points.map(([, mm]) => mm ?? -Infinity)), 3);
  const known = truth ? `, true ${deepest(truth)} mm (dashed)` : "";
  return `${fixed(measured.at(-1)[0], 2)} mm long, deepest ${deepest(measured)} mm${known}`;
}
