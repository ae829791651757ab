// Indentation over the last minutes, in mm; while the page is paused, an earlier frame can be chosen on it.

import { onDrag, onKey, shares } from "./hand.js";
import { plot, roundUp } from "./plot.js";

const LEAST_SCALE_MM = 0.1;
const STEPS = { ArrowLeft: -1, ArrowRight: 1, PageUp: -10, PageDown: 10 };

export class History {
  spanS = 15;
  cursorS = null; // when the frame was taken that is held; null where the newest is shown
  #chart;
  #recent;
  #timeAt = () => 0; // from a share of the chart's width to seconds before the newest frame

  /** Show the frames of `recent`; `choose(frame)` is called when one is pointed at, or stepped to by the arrow keys. */
  constructor(chart, recent, choose) {
    this.#chart = chart;
    this.#recent = recent;
    const point = (event) => choose(recent.nearest(this.#nowS + this.#timeAt(shares(event, chart)[0])));
    onDrag(chart, { take: point, move: point });
    onKey(chart, ({ key }) => (key in STEPS ? choose(recent.step(this.cursorS, STEPS[key])) : false));
  }

  get #nowS() {
    return this.#recent.frames.at(-1)?.timeS ?? 0;
  }

  draw() {
    const now = this.#nowS;
    const shown = this.#recent.frames.map(({ timeS, peakMm }) => [timeS - now, peakMm]);
    const points = shown.filter(([time]) => time >= -this.spanS);
    const cursor = this.cursorS === null ? null : this.cursorS - now;
    this.#timeAt = plot(this.#chart, {
      x: { from: -this.spanS, to: 0, label: "s before the newest frame" },
      y: { from: 0, to: roundUp(Math.max(LEAST_SCALE_MM, ...points.map(([, mm]) => mm))), label: "mm" },
      curves: [{ points, filled: true }],
      cursor,
    });
    this.#chart.setAttribute("aria-valuenow", (cursor ?? 0).toFixed(1));
    this.#chart.setAttribute("aria-valuetext", `${(-(cursor ?? 0)).toFixed(1)} s before the newest frame`);
  }
}
