// The picture of the wizard, with the circle of a press on it that can be dragged.

import { clamp, onDrag, shares } from "./hand.js";

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
    const take = (event) => this.#take(event);
    const move = (event) => {
      this.#drag(this.#place(event));
      this.#draw();
    };
    const end = () => {
      this.#drag = null;
      const { x, y, radius } = this.#circle;
      onChange({ center_x_px: x, center_y_px: y, contact_radius_px: radius });
    };
    onDrag(canvas, { take, move, end });
  }

  get dragging() {
    return this.#drag !== null;
  }

  /** Show `image` with the circle of `press`, null for none, unless the visitor holds what is there. */
  show(image, press, editable) {
    if (this.dragging) return;
    this.#image = image;
    Object.assign(this.#canvas, { width: image.width, height: image.height });
    this.#circle = press && { x: press.center_x_px, y: press.center_y_px, radius: press.contact_radius_px };
    this.#editable = Boolean(press) && editable;
    this.#canvas.classList.toggle("editable", this.#editable);
    this.#draw();
  }

  /** Place of a pointer in px of the image. */
  #place(event) {
    const [x, y] = shares(event, this.#canvas);
    return [x * this.#canvas.width, y * this.#canvas.height];
  }

  /** Choose what a pointer does that goes down; return whether it does anything. */
  #take(event) {
    if (!this.#editable || event.button !== 0) return false;
    const [fromX, fromY] = this.#place(event);
    const circle = this.#circle;
    const [right, down] = [fromX - circle.x, fromY - circle.y];
    const distance = Math.hypot(right, down);
    const { width, height } = this.#canvas;
    const moved = (from, size) => clamp(from, 0, size - 1);
    if (Math.abs(distance - circle.radius) < (HANDLE_PX * width) / this.#canvas.clientWidth) {
      this.#drag = ([x, y]) => { circle.radius = Math.max(LEAST_RADIUS, Math.hypot(x - circle.x, y - circle.y)); };
    } else if (distance < circle.radius) {
      this.#drag = ([x, y]) => Object.assign(circle, { x: moved(x - right, width), y: moved(y - down, height) });
    }
    return this.dragging;
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
