// Pressing objects into the simulated gel: the pointer says where, the slider and the wheel say how deep.

import { command } from "./command.js";
import { button, element, write } from "./dom.js";

const DEPTH_STEP_MM = 0.05;

export class PressPanel {
  #object = "";
  #place = [0, 0];
  #active = false; // an object of ours is in the gel
  #busy = false; // a command waits for its answer
  #next = null; // the newest command that waits for its turn
  #slider = element("press-depth");
  #advice = element("press-hint").textContent;

  constructor() {
    this.#slider.addEventListener("input", () => this.#setDepth(this.depthMm));
    element("press-here").addEventListener("click", () => this.#press(this.#place));
    element("release").addEventListener("click", () => this.release());
    element("objects").addEventListener("keydown", (event) => this.#turnObjects(event));
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
    if (stage.preparing) this.#goOn();
    if (element("objects").childElementCount !== stage.objects.length) this.#fill(stage);
    const who = stage.visitor ? "you" : "programme";
    if (stage.preparing) write("stage-now", `preparing ${stage.preparing}`);
    else write("stage-now", stage.depth_mm > 0 ? `${who}: ${stage.object} ${stage.depth_mm.toFixed(2)} mm` : `${who}: nothing pressed`);
  }

  /** Whether there is something to press objects into. */
  get offered() {
    return !element("press").hidden;
  }

  /** Where the last press was, mm from the middle of the picture. */
  get place() {
    return this.#place;
  }

  /** Choose an object where it is offered. */
  offer(name) {
    if (element("objects").querySelector(`[data-testid="object-${name}"]`)) this.#choose(name);
  }

  /** Press what is chosen, until it is released. */
  pressAt(place) {
    this.#press(place);
  }

  /** Whether objects can be pressed now. */
  get ready() {
    return !element("press").hidden && !element("press-controls").disabled;
  }

  /** Offer no press while there is a reason against it; an empty reason allows it again. */
  forbid(reason) {
    element("press-controls").disabled = reason !== "";
    if (!element("press-hint").classList.contains("wrong")) element("press-hint").textContent = reason || this.#advice;
  }

  /** Say why what was asked for could not be done; "" where it was. */
  #say(refusal) {
    const hint = element("press-hint");
    hint.textContent = refusal || this.#advice;
    hint.classList.toggle("wrong", refusal !== "");
  }

  /** Send what waits: a press that is being computed answers late, and a newer command takes its place. */
  #goOn() {
    this.#busy = false;
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
    element("objects").replaceChildren(...objects.map((name) => button(name, () => this.#choose(name), "", { role: "radio", testid: `object-${name}` })));
    this.#choose(objects[0]);
  }

  /** Let the arrow keys choose among the objects, as in any group of which one is chosen. */
  #turnObjects(event) {
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    const buttons = [...element("objects").children];
    const next = buttons[(buttons.indexOf(event.target) + step + buttons.length) % buttons.length];
    this.#choose(next.textContent);
    next.focus();
  }

  #choose(name) {
    this.#object = name;
    for (const button of element("objects").children) {
      button.setAttribute("aria-checked", button.textContent === name);
      button.tabIndex = button.textContent === name ? 0 : -1;
    }
    if (this.#active) this.#press(this.#place);
  }

  #setDepth(depthMm) {
    this.#slider.value = depthMm;
    element("press-depth-mm").textContent = `${this.depthMm.toFixed(2)} mm`;
    if (this.#active) this.#press(this.#place);
  }

  // ---- the tool of the pictures: see `Pictures` ----

  down(place) {
    if (this.ready) this.#press(place);
  }

  move(place) {
    if (this.#active) this.#press(place);
  }

  up() {
    if (this.#active && !element("hold").checked) this.release();
  }

  enter(place) {
    if (this.#active) this.release();
    else this.down(place);
  }

  /** Deepen the press that is there; without one the wheel scrolls the page. */
  wheel(event) {
    if (!this.#active) return;
    event.preventDefault();
    this.#setDepth(this.depthMm - Math.sign(event.deltaY) * DEPTH_STEP_MM);
  }

  #press(place) {
    this.#place = place;
    this.#active = true;
    this.#next = { type: "press", object: this.#object, depth_mm: this.depthMm, x_mm: place[0], y_mm: place[1] };
    this.#flush();
  }

  /** Lift the object off the gel, without waiting for a press that is being computed. */
  async release() {
    this.#active = false;
    this.#next = null;
    this.#say(await command({ type: "release" }));
  }

  async #flush() {
    if (this.#busy || !this.#next) return;
    this.#busy = true;
    const press = this.#next;
    this.#next = null;
    this.#say(await command(press));
    this.#goOn();
  }
}
