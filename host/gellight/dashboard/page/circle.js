// The picture of the wizard, with the circle of a press on it that can be dragged.

const HANDLE_PX = 16; // on the screen, how near to the rim counts as the rim
const LEAST_RADIUS = 4;

export class CirclePicture {
  #canvas;
  #image = null;
  #circle = null; // {x, y, radius} in px of the image
  #editable = false;
  #drag = null; // what a pointer that holds the circle does with it, at a place

  /** `onChange(circle)` is called when the visitor has let go of a circle that he changed. */
  constructor(canvas, onChange) {
    this.#canvas = canvas;
    canvas.addEventListener("pointerdown", (event) => this.#take(event));
    canvas.addEventListener("pointermove", (event) => {
      this.#drag?.(this.#place(event));
      if (this.#drag) this.#draw();
    });
    canvas.addEventListener("lostpointercapture", () => {
      if (!this.#drag) return;
      this.#drag = null;
      const { x, y, radius } = this.#circle;
      onChange({ center_x_px: x, center_y_px: y, contact_radius_px: radius });
    });
  }

  get dragging() {
    return this.#drag !== null;
  }

  /** Show `image` with the circle of `press`, null for none, unless the visitor holds what is there. */
  show(image, press, editable) {
    if (this.dragging) return;
    this.#image = image;
    const { width, height } = image;
    if (this.#canvas.width !== width || this.#canvas.height !== height) Object.assign(this.#canvas, { width, height });
    this.#circle = press && { x: press.center_x_px, y: press.center_y_px, radius: press.contact_radius_px };
    this.#editable = Boolean(press) && editable;
    this.#canvas.classList.toggle("editable", this.#editable);
    this.#draw();
  }

  /** Place of a pointer in px of the image, and how many of them a px of the screen is. */
  #place(event) {
    const box = this.#canvas.getBoundingClientRect();
    const scale = this.#canvas.width / box.width;
    return [(event.clientX - box.left) * scale, (event.clientY - box.top) * scale, scale];
  }

  #take(event) {
    if (!this.#editable || event.button !== 0) return;
    const [fromX, fromY, scale] = this.#place(event);
    const circle = this.#circle;
    const [right, down] = [fromX - circle.x, fromY - circle.y];
    const distance = Math.hypot(right, down);
    const { width, height } = this.#canvas;
    if (Math.abs(distance - circle.radius) < HANDLE_PX * scale) {
      this.#drag = ([x, y]) => { circle.radius = Math.max(LEAST_RADIUS, Math.hypot(x - circle.x, y - circle.y)); };
    } else if (distance < circle.radius) {
      this.#drag = ([x, y]) => Object.assign(circle, { x: within(x - right, width), y: within(y - down, height) });
    } else return;
    this.#canvas.setPointerCapture(event.pointerId);
  }

  #draw() {
    const pen = this.#canvas.getContext("2d");
    pen.drawImage(this.#image, 0, 0);
    if (!this.#circle) return;
    const { x, y, radius } = this.#circle;
    const line = this.#canvas.width / 320;
    const path = new Path2D(`M${x - 6 * line} ${y}h${12 * line}M${x} ${y - 6 * line}v${12 * line}M${x + radius} ${y}`);
    path.arc(x, y, radius, 0, 7);
    for (const [style, width] of [["rgba(0, 0, 0, .6)", 2.4 * line], [this.#editable ? "#f5b453" : "#4cc9c0", line]]) {
      pen.strokeStyle = style;
      pen.lineWidth = width;
      pen.stroke(path);
    }
  }
}

function within(place, size) {
  return Math.min(Math.max(place, 0), size - 1);
}
