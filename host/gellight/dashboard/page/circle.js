// The picture of the wizard, with the circle of a press on it that can be dragged.

const HANDLE_PX = 16; // on the screen, how near to the rim counts as the rim
const LEAST_RADIUS = 4;

export class CirclePicture {
  #canvas;
  #image = null;
  #circle = null; // {center_x_px, center_y_px, contact_radius_px}
  #editable = false;
  #dragged = null; // "centre" or "rim" while the pointer holds it
  #from = null;
  #onChange;

  /** `onChange(circle)` is called when the visitor has let go of a circle that he changed. */
  constructor(canvas, onChange) {
    this.#canvas = canvas;
    this.#onChange = onChange;
    canvas.addEventListener("pointerdown", (event) => this.#take(event));
    canvas.addEventListener("pointermove", (event) => this.#drag(event));
    canvas.addEventListener("lostpointercapture", () => this.#release());
  }

  get dragging() {
    return this.#dragged !== null;
  }

  /** Show an image; null shows that there is none. */
  show(image) {
    this.#image = image;
    if (image && (this.#canvas.width !== image.width || this.#canvas.height !== image.height)) {
      this.#canvas.width = image.width;
      this.#canvas.height = image.height;
    }
    this.#draw();
  }

  /** Lay a circle on the image, null for none; what the visitor holds is not taken out of his hand. */
  lay(circle, editable) {
    if (this.dragging) return;
    this.#circle = circle && { center_x_px: circle.center_x_px, center_y_px: circle.center_y_px, contact_radius_px: circle.contact_radius_px };
    this.#editable = Boolean(circle) && editable;
    this.#canvas.classList.toggle("editable", this.#editable);
    this.#draw();
  }

  #place(event) {
    const box = this.#canvas.getBoundingClientRect();
    const scale = this.#canvas.width / box.width;
    return [(event.clientX - box.left) * scale, (event.clientY - box.top) * scale, scale];
  }

  #take(event) {
    if (!this.#editable || event.button !== 0) return;
    const [x, y, scale] = this.#place(event);
    const distance = Math.hypot(x - this.#circle.center_x_px, y - this.#circle.center_y_px);
    if (Math.abs(distance - this.#circle.contact_radius_px) < HANDLE_PX * scale) this.#dragged = "rim";
    else if (distance < this.#circle.contact_radius_px) this.#dragged = "centre";
    else return;
    this.#from = [x - this.#circle.center_x_px, y - this.#circle.center_y_px];
    this.#canvas.setPointerCapture(event.pointerId);
  }

  #drag(event) {
    if (!this.#dragged) return;
    const [x, y] = this.#place(event);
    if (this.#dragged === "rim") {
      this.#circle.contact_radius_px = Math.max(LEAST_RADIUS, Math.hypot(x - this.#circle.center_x_px, y - this.#circle.center_y_px));
    } else {
      this.#circle.center_x_px = Math.min(Math.max(x - this.#from[0], 0), this.#canvas.width - 1);
      this.#circle.center_y_px = Math.min(Math.max(y - this.#from[1], 0), this.#canvas.height - 1);
    }
    this.#draw();
  }

  #release() {
    if (!this.#dragged) return;
    this.#dragged = null;
    this.#onChange({ ...this.#circle });
  }

  #draw() {
    const pen = this.#canvas.getContext("2d");
    pen.clearRect(0, 0, this.#canvas.width, this.#canvas.height);
    if (this.#image) pen.drawImage(this.#image, 0, 0);
    if (!this.#circle) return;
    const line = this.#canvas.width / 320;
    for (const [style, width] of [["rgba(0, 0, 0, .6)", 2.4 * line], [this.#editable ? "#f5b453" : "#4cc9c0", line]]) {
      pen.strokeStyle = style;
      pen.lineWidth = width;
      pen.beginPath();
      this.#traceCircle(pen, line);
      pen.stroke();
    }
  }

  #traceCircle(pen, line) {
    const { center_x_px: x, center_y_px: y, contact_radius_px: radius } = this.#circle;
    pen.arc(x, y, radius, 0, 7);
    pen.moveTo(x - 6 * line, y);
    pen.lineTo(x + 6 * line, y);
    pen.moveTo(x, y - 6 * line);
    pen.lineTo(x, y + 6 * line);
  }
}
