// The flat pictures as a place to point at: pointer and arrow keys in mm on the gel.

import { sizeMm } from "./field.js";
import { ARROWS, clamp, onDrag, onKey, shares } from "./hand.js";

const STEP_MM = 0.5;
const SMALL_STEP_MM = 0.1;

/** A place in mm from the image centre, held inside the view. */
function inside(place, viewMm) {
  return place.map((mm, axis) => Math.trunc(clamp(mm, -viewMm[axis] / 2, viewMm[axis] / 2) * 100) / 100);
}

export class Pictures {
  #pointer;
  #tool;
  #viewMm = null;
  #cursor = [0, 0]; // where the arrow keys are

  /**
   * `pointer`.pointAt(place or null) is told of what is pointed at, the `tool()` in use of down(place), move(place),
   * up() and enter(place), `wheeled`.wheel(event); places are [x, y] in mm.
   */
  constructor(pointer, wheeled, tool) {
    this.#pointer = pointer;
    this.#tool = tool;
    for (const canvas of document.querySelectorAll(".picture canvas")) this.#listen(canvas, wheeled);
  }

  /** Learn the size of the view from a frame's header. */
  learn(header) {
    const size = sizeMm(header);
    if (this.#viewMm?.join() === size.join()) return;
    this.#viewMm = size;
    document.body.style.setProperty("--aspect", size[0] / size[1]);
  }

  #listen(canvas, wheeled) {
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "img");
    const point = (place) => this.#pointer.pointAt(place);
    const place = (event) => {
      const mm = (share, axis) => (share - 0.5) * this.#viewMm[axis];
      return inside(shares(event, canvas).map(mm), this.#viewMm);
    };
    canvas.addEventListener("pointermove", (event) => this.#viewMm && point(place(event)));
    onDrag(canvas, {
      take: (event) => Boolean(this.#viewMm) && event.button === 0 && this.#tool().down(place(event)),
      move: (event) => this.#tool().move(place(event)),
      end: () => this.#tool().up(),
    });
    canvas.addEventListener("pointerleave", () => point(null));
    canvas.addEventListener("wheel", (event) => wheeled.wheel(event), { passive: false });
    canvas.addEventListener("focus", () => canvas.matches(":focus-visible") && this.#viewMm && point(this.#cursor));
    canvas.addEventListener("blur", () => point(null));
    onKey(canvas, (event) => this.#key(event));
  }

  #key({ key, shiftKey }) {
    if (!this.#viewMm) return false;
    if (key === "Enter") return this.#tool().enter(this.#cursor);
    if (!(key in ARROWS)) return false;
    const step = shiftKey ? SMALL_STEP_MM : STEP_MM;
    const moved = this.#cursor.map((mm, axis) => Math.round((mm + ARROWS[key][axis] * step) * 100) / 100);
    this.#cursor = inside(moved, this.#viewMm);
    return this.#pointer.pointAt(this.#cursor);
  }
}
