// The flat pictures as a place to point at: pointer and arrow keys in mm on the gel, and the marks drawn over them.

import { node, shape } from "./dom.js";
import { sizeMm } from "./field.js";

const STEP_MM = 0.5;
const SMALL_STEP_MM = 0.1;
const DIRECTIONS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** Position in mm from the image centre of a pointer on a canvas that shows the whole view; held inside the view. */
export function pointerMm(event, canvas, viewMm) {
  const box = canvas.getBoundingClientRect();
  const from = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  return from.map((part, axis) => inside((part - 0.5) * viewMm[axis], viewMm[axis]));
}

function inside(mm, sizeMm) {
  return Math.trunc(Math.min(Math.max(mm, -sizeMm / 2), sizeMm / 2) * 100) / 100;
}

export class Pictures {
  #canvases;
  #listeners;
  #viewMm = null;
  #cursor = [0, 0]; // where the arrow keys are
  #marks;
  #marked = ""; // what is drawn over the pictures

  /**
   * `listeners`: point(place or null), and for the tool in use down(place), move(place), up(), enter(place), and
   * wheel(event); places are [x, y] in mm.
   */
  constructor(canvases, listeners) {
    this.#canvases = canvases;
    this.#listeners = listeners;
    this.#marks = canvases.map((canvas) => {
      const layer = node("div", "", "marks");
      canvas.after(layer);
      return layer;
    });
    for (const canvas of canvases) this.#listen(canvas);
  }

  /** Learn the size of the view from a frame's header. */
  learn(header) {
    const size = sizeMm(header);
    if (this.#viewMm?.join() === size.join()) return;
    this.#viewMm = size;
    document.body.style.setProperty("--aspect", size[0] / size[1]);
  }

  /**
   * Draw over every picture: `line` ([start, end] or null), `point` (or null), `moving` (an object's `axes` and
   * `path`, or null), `labels` [[text, place], ...], `arrows`
   * [[x, y, along x, along y], ...] and, larger, `pull` (one of these, or null).
   */
  mark({ line, point, moving = null, labels, arrows = [], pull = null }) {
    if (!this.#viewMm) return;
    const [width, height] = this.#viewMm;
    const marked = JSON.stringify([width, height, line, point, moving, labels, arrows, pull]);
    if (marked === this.#marked) return;
    this.#marked = marked;
    for (const layer of this.#marks) {
      const svg = shape("svg", { viewBox: `${-width / 2} ${-height / 2} ${width} ${height}`, preserveAspectRatio: "none" });
      if (line) svg.append(...strokes(`M${line[0]}L${line[1]}`), ...line.flatMap((end) => strokes(cross(end, 0.4))));
      if (moving) {
        svg.append(...strokes(`M${moving.path.join("L")}`));
        moving.axes.forEach(([from, to], axis) => svg.append(...strokes(`M${from}L${to}`, `axis-${"xyz"[axis]}`)));
      }
      if (arrows.length) svg.append(...strokes(arrows.map((one) => arrow(one, 0.4)).join("")));
      if (pull) svg.append(...strokes(arrow(pull, 1)).map((made) => (made.classList.add("pull"), made)));
      if (point) svg.append(...strokes(cross(point, 0.8)));
      layer.replaceChildren(svg, ...labels.map(([text, place]) => this.#label(text, place)));
    }
  }

  #label(text, [x, y]) {
    const label = node("span", text);
    label.style.left = `${(x / this.#viewMm[0] + 0.5) * 100}%`;
    label.style.top = `${(y / this.#viewMm[1] + 0.5) * 100}%`;
    return label;
  }

  #listen(canvas) {
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "img");
    const { point, down, move, up, wheel } = this.#listeners;
    const place = (event) => pointerMm(event, canvas, this.#viewMm);
    canvas.addEventListener("pointerdown", (event) => {
      if (!this.#viewMm || event.button !== 0) return;
      canvas.setPointerCapture(event.pointerId);
      down(place(event));
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!this.#viewMm) return;
      point(place(event));
      if (canvas.hasPointerCapture(event.pointerId)) move(place(event));
    });
    canvas.addEventListener("pointerleave", () => point(null));
    canvas.addEventListener("lostpointercapture", () => up());
    canvas.addEventListener("wheel", wheel, { passive: false });
    canvas.addEventListener("focus", () => canvas.matches(":focus-visible") && this.#viewMm && point(this.#cursor));
    canvas.addEventListener("blur", () => point(null));
    canvas.addEventListener("keydown", (event) => this.#key(event));
  }

  #key(event) {
    if (!this.#viewMm || event.ctrlKey || event.metaKey || event.altKey) return;
    const direction = DIRECTIONS[event.key];
    if (direction) {
      const step = event.shiftKey ? SMALL_STEP_MM : STEP_MM;
      this.#cursor = this.#cursor.map((mm, axis) => inside(Math.round((mm + direction[axis] * step) * 100) / 100, this.#viewMm[axis]));
      this.#listeners.point(this.#cursor);
    } else if (event.key === "Enter") this.#listeners.enter(this.#cursor);
    else return;
    event.preventDefault();
  }
}

function strokes(path, also = "") {
  return ["under", `over ${also}`].map((kind) => shape("path", { class: kind, d: path }));
}

/** An arrow with a head of so many mm; none where it would be shorter than it is wide. */
function arrow([x, y, dx, dy], head) {
  const length = Math.hypot(dx, dy);
  if (length < head / 4) return "";
  const [ux, uy] = [(dx / length) * Math.min(head, length / 2), (dy / length) * Math.min(head, length / 2)];
  const [tipX, tipY] = [x + dx, y + dy];
  return `M${x} ${y}L${tipX} ${tipY}M${tipX - ux - uy / 2} ${tipY - uy + ux / 2}L${tipX} ${tipY}L${tipX - ux + uy / 2} ${tipY - uy - ux / 2}`;
}

function cross([x, y], size) {
  return `M${x - size} ${y}H${x + size}M${x} ${y - size}V${y + size}`;
}
