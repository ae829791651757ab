// The object that is tracked: its axes over the pictures, and the way that it has come.

import { command } from "./command.js";
import { write } from "./dom.js";

const MOST_PLACES = 400;
const AXIS_MM = 2;

export class Tracking {
  #button;
  #places = [];
  #number = 0;

  /** `button` switches tracking; in a simulated gel something moves by itself meanwhile. */
  constructor(button) {
    this.#button = button;
    button.addEventListener("click", () => command({ type: "track", on: !this.on, hand: true }));
  }

  get on() {
    return this.#button.getAttribute("aria-pressed") === "true";
  }

  /** Take in the server's status. */
  show({ tracking }) {
    this.#button.setAttribute("aria-pressed", Boolean(tracking));
  }

  /** Return what to draw of the object of a frame, null where there is none: `axes` and `path`, in mm. */
  follow(pose) {
    write("pose", pose?.text ?? "");
    if (!pose || pose.lost) return null;
    if (pose.number !== this.#number) this.#places = [];
    this.#number = pose.number;
    this.#places = [...this.#places.slice(1 - MOST_PLACES), pose.place_mm];
    const [x, y] = pose.place_mm;
    const axes = pose.axes.map(([right, down]) => [[x, y], [x + AXIS_MM * right, y + AXIS_MM * down]]);
    return { axes, path: this.#places };
  }
}
