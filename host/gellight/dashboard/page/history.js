// Indentation over the last minutes, in mm; while the page is paused, an earlier moment can be chosen on it.

import { onDrag, onKey } from "./hand.js";
import { plot, roundUp } from "./plot.js";

const KEPT_S = 300;
const LEAST_SCALE_MM = 0.1;
const STEPS = { ArrowLeft: -1, ArrowRight: 1, PageUp: -10, PageDown: 10 };

export class History {
  #canvas;
  #points = []; // [time in s, indentation in mm], oldest first
  #spanS = 15;
  #cursorS = null; // the moment that is shown; null is the newest
  #timeAt = () => 0; // from a px of the canvas to seconds before the newest point
  #drawn = null; // the newest point when the chart was drawn

  /** `listeners`: choose(timeS) when a moment is pointed at, step(count) for the arrow keys. */
  constructor(canvas, listeners) {
    this.#canvas = canvas;
    const point = ({ offsetX }) => {
      if (this.#points.length) listeners.choose(this.#points.at(-1)[0] + this.#timeAt(offsetX));
    };
    onDrag(canvas, { take: point, move: point });
    onKey(canvas, ({ key }) => (key in STEPS ? listeners.step(STEPS[key]) : false));
    new ResizeObserver(() => this.draw(true)).observe(canvas);
  }

  /** Add an indentation in mm at `timeS`. */
  add(timeS, indentationMm) {
    if (this.#points.length && timeS < this.#points.at(-1)[0]) this.#points = []; // the sensor's clock was restarted
    this.#points.push([timeS, indentationMm]);
    while (this.#points[0][0] < timeS - KEPT_S) this.#points.shift();
  }

  /** Show the last `spanS` seconds, and mark the moment that is shown, `cursorS`; null where it is the newest. */
  set({ spanS = this.#spanS, cursorS = this.#cursorS }) {
    this.#spanS = spanS;
    this.#cursorS = cursorS;
    this.draw(true);
  }

  /** Draw the chart, if there is a newer point or `anew`. */
  draw(anew = false) {
    const newest = this.#points.at(-1) ?? [0, 0];
    if (newest === this.#drawn && !anew) return;
    this.#drawn = newest;
    const [now] = newest;
    const shown = this.#points.filter(([time]) => time >= now - this.#spanS).map(([time, mm]) => [time - now, mm]);
    const top = roundUp(Math.max(LEAST_SCALE_MM, ...shown.map(([, mm]) => mm)));
    const cursor = this.#cursorS === null ? null : this.#cursorS - now;
    this.#timeAt = plot(this.#canvas, {
      x: { from: -this.#spanS, to: 0, label: "s before the newest frame" },
      y: { from: 0, to: top, label: "mm" },
      curves: [{ points: shown, filled: true }],
      cursor,
    });
    this.#canvas.setAttribute("aria-valuenow", (cursor ?? 0).toFixed(1));
    this.#canvas.setAttribute("aria-valuetext", `${(-(cursor ?? 0)).toFixed(1)} s before the newest frame`);
  }
}
