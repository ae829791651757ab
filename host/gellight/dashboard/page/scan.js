// A scan by hand: what to do next, the map as far as it is, and where no press has been.

import { command, fetchFile } from "./command.js";
import { element, html, nothing, render, svg } from "./dom.js";
import { clamp } from "./hand.js";

const STEPS = {
  press: "Press over half of a press that was", hold: "Hold it still", lift: "Lift it",
  join: "Finding its place: press beside meanwhile",
};
const NONE = {
  scanning: false, presses: 0, outlines: {}, sides: {}, map: null, refused: false,
  said: "Presses beside each other become one map of a flat part larger than the view.",
};
const AROUND_MM = 1;
const PART = "PCONVEX"; // of a simulated sensor: larger than half of the view, and the same nowhere else

export class ScanPanel {
  #press;
  #button = element("scan");
  #state = NONE;
  #led = false; // a press of ours is in the simulated gel, and is lifted once it was still
  #lifted = []; // where the presses were that wait to be joined
  #places = new Map(); // where each press was, by its number
  #refusal = "";

  /** `press`: the panel that presses objects into a simulated gel. */
  constructor(press) {
    this.#press = press;
    this.#button.addEventListener("click", () => this.#open(element("scan-panel").hidden));
  }

  /** Show what the server says of the scan. */
  show({ can_scan: can, scan }) {
    this.#button.hidden = !can;
    const before = this.#state;
    this.#state = scan ?? NONE;
    if (this.#state.scanning && before === NONE) this.#open(true);
    if (this.#state.said !== before.said) this.#refusal = "";
    this.#lead();
    this.#notePlaces(before);
    this.#draw();
  }

  #open(wanted) {
    element("scan-panel").hidden = !wanted;
    this.#button.setAttribute("aria-pressed", wanted);
  }

  #draw() {
    const { scanning, presses, map, said, refused, folder } = this.#state;
    const file = (kind) => html`<a class="link" href="scan/file/map.${kind.toLowerCase()}" download
      @click=${(event) => this.#save(event)}>${kind}</a> `;
    render(html`${map ? this.#map() : nothing}
      <div class="scan-words">
        <h2 data-testid="scan-step" role="status">${this.#step()}</h2>
        <p class=${this.#refusal || refused ? "hint wrong" : "hint"} data-testid="scan-said"
          role="status">${this.#refusal || said}</p>
        <form class="buttons" ?hidden=${scanning} @submit=${(event) => this.#begin(event)}>
          <label for="scan-name">name</label>
          <input id="scan-name" data-testid="scan-name" value="part" required maxlength="64"
            pattern="[A-Za-z0-9][A-Za-z0-9_\\-]*" title="letters, digits, - and _; a scan that is there goes on">
          <button data-testid="scan-start">Begin</button>
        </form>
        ${!scanning ? nothing : html`<div id="scan-controls">
          <div class="buttons" data-testid="scan-sides">${this.#sides()}</div>
          <div class="buttons">
            <button data-testid="scan-undo" title="take the last press back" ?disabled=${presses === 0}
              @click=${() => this.#ask({ type: "scan-undo" })}>Undo</button>
            <button data-testid="scan-end" @click=${() => this.#ask({ type: "scan-end" })}>End</button>
          </div>
        </div>`}
        <p class="value" data-testid="scan-figures">${figuresOf(this.#state)}</p>
        ${map ? html`<p class="buttons" data-testid="scan-files">Save
          ${["PNG", "NPZ", "PLY", "STL", "X3P"].map(file)}</p>` : nothing}
        <p class="hint mono">${presses ? `gellight scan ${folder}` : ""}</p>
      </div>`, element("scan-panel"));
  }

  #step() {
    const { scanning, presses, phase } = this.#state;
    if (this.#state === NONE) return "Scan";
    if (!scanning) return "Ended";
    return presses === 0 && phase === "press" ? "Press the part into the gel" : STEPS[phase];
  }

  #begin(event) {
    event.preventDefault();
    this.#press.offer(PART);
    this.#ask({ type: "scan", name: element("scan-name").value });
  }

  async #ask(call) {
    this.#refusal = await command(call);
    this.#draw();
  }

  async #save(event) {
    event.preventDefault();
    this.#refusal = await fetchFile(event.target.href);
    this.#draw();
  }

  /** Lift our own press once it was still. */
  #lead() {
    if (!this.#led || this.#state.phase !== "lift") return;
    this.#led = false;
    this.#press.release();
  }

  /** Note where a press was when it is lifted: until it has its number, the next one may be under way. */
  #notePlaces(before) {
    const { phase, presses, last } = this.#state;
    if (before.phase === "lift" && phase !== "lift") this.#lifted.push(this.#press.place);
    const joined = before !== NONE && presses > before.presses;
    if (joined && this.#lifted.length) this.#places.set(last, this.#lifted.shift());
  }

  /** Return where the part was at a press, by its own place or that of another one, mm. */
  #placeOf(number, outlines) {
    const known = Object.keys(outlines).find((other) => this.#places.has(Number(other)));
    if (known === undefined) return [0, 0];
    return this.#places.get(Number(known)).map((mm, axis) => mm + outlines[known][0][axis] - outlines[number][0][axis]);
  }

  /** The sides where no press has been; on a simulated sensor each presses there. */
  #sides() {
    const { presses, sides } = this.#state;
    const named = presses === 0 ? [["here", { shift_mm: [0, 0] }]] : Object.entries(sides);
    const names = named.map(([side]) => side).join(", ");
    if (!this.#press.offered) return presses && names ? `not scanned yet: ${names}` : "";
    return named.map(([side, { shift_mm: shift }]) => html`<button data-testid="scan-${side}"
      @click=${() => this.#pressBeside(shift)}>Press ${side}</button>`);
  }

  /** Press where the sensor would be moved by `shift` over the part: there the part is moved the other way. */
  #pressBeside(shift) {
    const { outlines } = this.#state;
    const number = Object.keys(outlines).at(-1);
    const outline = outlines[number];
    const place = outline ? this.#placeOf(number, outlines) : [0, 0];
    const side = (axis) => outline[axis + 1].map((mm, along) => mm - outline[axis][along]);
    const half = [0, 1].map((axis) => (outline ? Math.hypot(...side(axis)) / 2 : 0));
    this.#led = true;
    this.#press.pressAt(place.map((mm, axis) => clamp(mm - shift[axis], -half[axis], half[axis])));
  }

  #map() {
    const { map: { size_mm: [width, height] }, version, outlines, sides, scanning } = this.#state;
    const open = scanning ? Object.values(sides).map(({ outline }) => outline) : [];
    const corners = [[0, 0], [width, height], ...open.flat()];
    const [left, top] = [0, 1].map((axis) => Math.min(...corners.map((corner) => corner[axis])) - AROUND_MM);
    const [right, bottom] = [0, 1].map((axis) => Math.max(...corners.map((corner) => corner[axis])) + AROUND_MM);
    const polygon = (kind) => (outline) => svg`<polygon points=${outline.join(" ")} class=${kind}></polygon>`;
    return html`<svg id="scan-map" class="scan-map" data-testid="scan-map" role="img"
      aria-label="the map so far: numbered frames are presses, dashed ones are not scanned yet"
      viewBox="${left} ${top} ${right - left} ${bottom - top}">
      <image href="scan/map?${version}" x="0" y="0" width=${width} height=${height} preserveAspectRatio="none"></image>
      ${open.map(polygon("open"))}${Object.values(outlines).map(polygon("pressed"))}
      ${Object.entries(outlines).map(([number, outline]) => label(number, outline, (right - left) / 22))}</svg>`;
  }
}

function label(text, [[left, top], , [right, bottom]], size) {
  return svg`<text x=${(left + right) / 2} y=${(top + bottom) / 2} font-size=${size}>${text}</text>`;
}

function figuresOf({ presses, lost, map }) {
  if (!map) return "";
  const [width, height] = map.size_mm;
  const joined = lost.length ? [`not joined: ${lost.join(", ")}`] : [];
  const seam = typeof map.seam_um === "number" ? [`presses differ by ${map.seam_um.toFixed(1)} µm`] : [];
  const size = `${width.toFixed(0)} × ${height.toFixed(0)} mm`;
  const reached = `the gel reached ${(100 * map.reached).toFixed(0)} %`;
  return [`${presses} press${presses === 1 ? "" : "es"}`, ...joined, size, reached, ...seam].join("; ");
}
