// The flat pictures as a place to point at: pointer and arrow keys in mm on the gel.

import { sizeMm } from "./field.js";

const STEP_MM = 0.5;
const SMALL_STEP_MM = 0.1;
const DIRECTIONS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** Position in mm from the image centre of a pointer on a canvas that shows the whole view; held inside the view. */
function pointerMm(event, canvas, viewMm) {
  const box = canvas.getBoundingClientRect();
  const from = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  return from.map((part, axis) => inside((part - 0.5) * viewMm[axis], viewMm[axis]));
}

function inside(mm, sizeMm) {
  return Math.trunc(Math.min(Math.max(mm, -sizeMm / 2), sizeMm / 2) * 100) / 100;
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
  constructor(canvases, pointer, wheeled, tool) {
    this.#pointer = pointer;
    this.#tool = tool;
    for (const canvas of canvases) this.#listen(canvas, wheeled);
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
    const place = (event) => pointerMm(event, canvas, this.#viewMm);
    canvas.addEventListener("pointerdown", (event) => {
      if (!this.#viewMm || event.button !== 0) return;
      canvas.setPointerCapture(event.pointerId);
      this.#tool().down(place(event));
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!this.#viewMm) return;
      point(place(event));
      if (canvas.hasPointerCapture(event.pointerId)) this.#tool().move(place(event));
    });
    canvas.addEventListener("pointerleave", () => point(null));
    canvas.addEventListener("lostpointercapture", () => this.#tool().up());
    canvas.addEventListener("wheel", (event) => wheeled.wheel(event), { passive: false });
    canvas.addEventListener("focus", () => canvas.matches(":focus-visible") && this.#viewMm && point(this.#cursor));
    canvas.addEventListener("blur", () => point(null));
    canvas.addEventListener("keydown", (event) => this.#key(event));
  }

  #key(event) {
    if (!this.#viewMm || event.ctrlKey || event.metaKey || event.altKey) return;
    const direction = DIRECTIONS[event.key];
    if (direction) {
      const step = event.shiftKey ? SMALL_STEP_MM : STEP_MM;
      const moved = this.#cursor.map((mm, axis) => Math.round((mm + direction[axis] * step) * 100) / 100);
      this.#cursor = moved.map((mm, axis) => inside(mm, this.#viewMm[axis]));
      this.#pointer.pointAt(this.#cursor);
    } else if (event.key === "Enter") this.#tool().enter(this.#cursor);
    else return;
    event.preventDefault();
  }
}
