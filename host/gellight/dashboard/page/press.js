// Pressing objects into the simulated gel: the pointer says where, the slider and the wheel say how deep.

import { command } from "./command.js";
import { element, html, render } from "./dom.js";

const DEPTH_STEP_MM = 0.05;
const ADVICE = "Hold the pointer on a picture to press there; drag to move; turn the wheel meanwhile for depth.";

export class PressPanel {
  place = [0, 0]; // of the last press, mm from the middle of the picture
  #stage = null; // what it says of itself
  #object = "";
  #active = false; // an object of ours is in the gel
  #busy = false; // a command waits for its answer
  #next = null; // the newest command that waits for its turn
  #forbidden = ""; // why nothing can be pressed
  #refusal = ""; // why what was asked for could not be done

  /** Show what the stage says of itself; null hides the panel. */
  show(stage) {
    this.#stage = stage;
    element("press").hidden = !stage;
    document.body.classList.toggle("can-press", Boolean(stage));
    if (!stage) return;
    if (!stage.objects.includes(this.#object)) [this.#object] = stage.objects;
    if (stage.preparing) this.#goOn();
    this.#draw();
  }

  /** Offer no press while there is a reason against it; an empty reason allows it again. */
  forbid(reason) {
    this.#forbidden = reason;
    if (this.#stage) this.#draw();
  }

  /** Whether there is something to press objects into. */
  get offered() {
    return Boolean(this.#stage);
  }

  /** Choose an object where it is offered. */
  offer(name) {
    if (this.#stage?.objects.includes(name)) this.#choose(name);
  }

  /** Forget what was asked of a server that is gone. */
  reset() {
    this.#busy = false;
    this.#next = null;
    this.#active = false;
  }

  #draw() {
    const { objects, max_depth_mm: deepest } = this.#stage;
    const depthMm = Number(element("press-depth")?.value ?? 0.8);
    render(html`
      <div class="head">
        <h2>Press <span class="dim" id="stage-now" data-testid="stage-now">${this.#now()}</span></h2>
      </div>
      <fieldset ?disabled=${this.#forbidden !== ""}>
        <div class="objects" role="radiogroup" aria-label="object">${objects.map((name) => this.#choice(name))}</div>
        <label class="slider">depth
          <input id="press-depth" data-testid="press-depth" type="range" min="0" max=${deepest} step="0.05"
            value="0.8" @input=${() => this.#changed()}>
          <output class="mono" data-testid="press-depth-mm">${depthMm.toFixed(2)} mm</output></label>
        <div class="buttons">
          <button data-testid="press-here" @click=${() => this.pressAt(this.place)}>Press</button>
          <button data-testid="release" @click=${() => this.release()}>Release</button>
          <label class="keep"><input id="hold" data-testid="hold" type="checkbox"> keep pressed</label>
        </div>
      </fieldset>
      <p class=${this.#refusal ? "hint wrong" : "hint"}
        data-testid="press-hint">${this.#refusal || this.#forbidden || ADVICE}</p>`, element("press"));
  }

  #now() {
    const { preparing, visitor, object, depth_mm: depthMm } = this.#stage;
    if (preparing) return `preparing ${preparing}`;
    const pressed = depthMm > 0 ? `${object} ${depthMm.toFixed(2)} mm` : "nothing pressed";
    return `${visitor ? "you" : "programme"}: ${pressed}`;
  }

  #choice(name) {
    return html`<label><input type="radio" name="object" data-testid="object-${name}"
      .checked=${name === this.#object} @change=${() => this.#choose(name)}>${name}</label>`;
  }

  #choose(name) {
    this.#object = name;
    this.#changed();
  }

  /** The object or its depth is another one now. */
  #changed() {
    this.#draw();
    if (this.#active) this.pressAt(this.place);
  }

  // ---- the tool of the pictures: see `Pictures` ----

  down(place) {
    if (this.#stage && !this.#forbidden) this.pressAt(place);
  }

  move(place) {
    if (this.#active) this.pressAt(place);
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
    element("press-depth").value -= Math.sign(event.deltaY) * DEPTH_STEP_MM;
    this.#changed();
  }

  /** Press what is chosen, until it is released. */
  pressAt(place) {
    this.place = place;
    this.#active = true;
    const depthMm = Number(element("press-depth").value);
    this.#next = { type: "press", object: this.#object, depth_mm: depthMm, x_mm: place[0], y_mm: place[1] };
    this.#flush();
  }

  /** Lift the object off the gel, without waiting for a press that is being computed. */
  release() {
    this.#active = false;
    this.#next = null;
    return this.#ask({ type: "release" });
  }

  async #flush() {
    if (this.#busy || !this.#next) return;
    this.#busy = true;
    const press = this.#next;
    this.#next = null;
    await this.#ask(press);
    this.#goOn();
  }

  /** Send what waits: a press that is being computed answers late, and a newer command takes its place. */
  #goOn() {
    this.#busy = false;
    this.#flush();
  }

  async #ask(call) {
    this.#refusal = await command(call);
    if (this.#stage) this.#draw();
  }
}
