// Pressing objects into the simulated gel: the pointer says where, the slider and the wheel say how deep.

const element = (id) => document.getElementById(id);
const DEPTH_STEP_MM = 0.05;

/** Position in mm from the image centre of a pointer on a canvas that shows the view, letterboxed; held inside the view. */
export function pointerMm(event, canvas, viewMm) {
  const box = canvas.getBoundingClientRect();
  const scale = Math.min(box.width / canvas.width, box.height / canvas.height);
  const shown = [canvas.width * scale, canvas.height * scale];
  const from = [event.clientX - box.left - box.width / 2, event.clientY - box.top - box.height / 2];
  return from.map((offset, axis) => {
    const fraction = Math.min(Math.max(offset / shown[axis], -0.5), 0.5);
    return Math.trunc(fraction * viewMm[axis] * 100) / 100;
  });
}

export class PressPanel {
  #send;
  #object = "";
  #place = [0, 0];
  #active = false; // an object of ours is in the gel
  #busy = false; // a command waits for its answer
  #next = null; // the newest command that waits for its turn
  #viewMm = null;
  #slider = element("press-depth");
  #advice = element("press-hint").textContent;

  /** `send(command)` sends to the server; `canvases` are those the pointer presses on. */
  constructor(send, canvases) {
    this.#send = send;
    for (const canvas of canvases) this.#listen(canvas);
    this.#slider.addEventListener("input", () => this.#setDepth(this.depthMm));
    element("press-here").addEventListener("click", () => this.#press(this.#place));
    element("release").addEventListener("click", () => this.#release());
    this.#setDepth(this.depthMm);
  }

  get depthMm() {
    return Number(this.#slider.value);
  }

  /** Show what the stage says of itself; null hides the panel. */
  show(stage) {
    element("press").hidden = !stage;
    document.body.classList.toggle("can-press", Boolean(stage));
    if (!stage) return;
    if (element("objects").childElementCount !== stage.objects.length) this.#fill(stage);
    const who = stage.visitor ? "you" : "programme";
    element("stage-now").textContent = stage.depth_mm > 0 ? `${who}: ${stage.object} ${stage.depth_mm.toFixed(2)} mm` : `${who}: nothing pressed`;
  }

  /** Learn the size of the view in mm from a frame's header. */
  learn({ image_px: image, pixel_size_mm: pixel }) {
    this.#viewMm = [image[0] * pixel[0], image[1] * pixel[1]];
  }

  /** Take in the server's answer to a command; send what has waited for it. */
  answer({ type, message }) {
    this.#busy = false;
    const hint = element("press-hint");
    hint.textContent = type === "error" ? message : this.#advice;
    hint.classList.toggle("wrong", type === "error");
    this.#flush();
  }

  /** Forget what was asked of a server that is gone. */
  reset() {
    this.#busy = false;
    this.#next = null;
    this.#active = false;
  }

  #fill({ objects, max_depth_mm: deepest }) {
    this.#slider.max = deepest;
    this.#setDepth(this.depthMm);
    const buttons = objects.map((name) => {
      const button = Object.assign(document.createElement("button"), { textContent: name });
      button.dataset.testid = `object-${name}`;
      button.setAttribute("role", "radio");
      button.addEventListener("click", () => this.#choose(name));
      return button;
    });
    element("objects").replaceChildren(...buttons);
    this.#choose(objects[0]);
  }

  #choose(name) {
    this.#object = name;
    for (const button of element("objects").children) button.setAttribute("aria-checked", button.textContent === name);
    if (this.#active) this.#press(this.#place);
  }

  #setDepth(depthMm) {
    this.#slider.value = depthMm;
    element("press-depth-mm").textContent = `${this.depthMm.toFixed(2)} mm`;
    if (this.#active) this.#press(this.#place);
  }

  #listen(canvas) {
    canvas.addEventListener("pointerdown", (event) => {
      if (!this.#ready() || event.button !== 0) return;
      canvas.setPointerCapture(event.pointerId);
      this.#press(pointerMm(event, canvas, this.#viewMm));
    });
    canvas.addEventListener("pointermove", (event) => {
      if (canvas.hasPointerCapture(event.pointerId)) this.#press(pointerMm(event, canvas, this.#viewMm));
    });
    canvas.addEventListener("lostpointercapture", () => element("hold").checked || this.#release());
    canvas.addEventListener("wheel", (event) => this.#turnWheel(event), { passive: false });
  }

  #turnWheel(event) {
    if (!this.#ready()) return;
    event.preventDefault();
    this.#setDepth(this.depthMm - Math.sign(event.deltaY) * DEPTH_STEP_MM);
  }

  #ready() {
    return this.#viewMm !== null && !element("press").hidden;
  }

  #press(place) {
    this.#place = place;
    this.#active = true;
    this.#next = { type: "press", object: this.#object, depth_mm: this.depthMm, x_mm: place[0], y_mm: place[1] };
    this.#flush();
  }

  #release() {
    this.#active = false;
    this.#next = { type: "release" };
    this.#flush();
  }

  #flush() {
    if (this.#busy || !this.#next) return;
    this.#busy = this.#send(this.#next);
    this.#next = null;
  }
}
