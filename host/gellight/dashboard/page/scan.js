// A scan by hand: what to do next, the map as far as it is, and where no press has been.

import { command } from "./command.js";
import { button, element, shape, write } from "./dom.js";
import { fetchFile } from "./saving.js";

const STEPS = { press: "Press over half of a press that was", hold: "Hold it still", lift: "Lift it", join: "Finding its place: press beside meanwhile" };
const AROUND_MM = 1;
const PART = "PCONVEX"; // of a simulated sensor: larger than half of the view, and the same nowhere else

export class ScanPanel {
  #press;
  #button = element("scan");
  #state = null;
  #drawn = ""; // what the map shows
  #led = false; // a press of ours is in the simulated gel, and is lifted once it was still
  #lifted = []; // where the presses were that wait to be joined
  #places = new Map(); // where each press was, by its number
  #refusal = "";

  /** `press`: the panel that presses objects into a simulated gel. */
  constructor(press) {
    this.#press = press;
    this.#button.addEventListener("click", () => this.#open(element("scan-panel").hidden));
    element("scan-begin").addEventListener("submit", (event) => this.#begin(event));
    element("scan-undo").addEventListener("click", () => this.#ask({ type: "scan-undo" }));
    element("scan-end").addEventListener("click", () => this.#ask({ type: "scan-end" }));
    for (const link of element("scan-files").querySelectorAll("a")) link.addEventListener("click", (event) => this.#save(event, link));
  }

  /** Show what the server says of the scan. */
  show({ can_scan: can, scan }) {
    this.#button.hidden = !can;
    const before = this.#state;
    this.#state = scan;
    if (!scan) return;
    if (scan.scanning && !before) this.#open(true);
    if (scan.said !== before?.said) this.#refusal = "";
    this.#lead(scan.phase);
    this.#notePlaces(scan, before);
    const first = scan.presses === 0 && scan.phase === "press";
    write("scan-step", scan.scanning ? (first ? "Press the part into the gel" : STEPS[scan.phase]) : "Ended");
    this.#say(this.#refusal || scan.said, Boolean(this.#refusal) || scan.refused);
    element("scan-begin").hidden = scan.scanning;
    element("scan-controls").hidden = !scan.scanning;
    element("scan-undo").disabled = scan.presses === 0;
    element("scan-files").hidden = !scan.map;
    write("scan-figures", figuresOf(scan));
    write("scan-folder", scan.presses ? `gellight scan ${scan.folder}` : "");
    const drawn = JSON.stringify([scan.version, scan.scanning, this.#press.offered]);
    if (drawn === this.#drawn) return;
    this.#drawn = drawn;
    this.#drawMap(scan);
    this.#offerSides(scan);
  }

  #open(wanted) {
    element("scan-panel").hidden = !wanted;
    this.#button.setAttribute("aria-pressed", wanted);
  }

  #say(text, wrong) {
    write("scan-said", text);
    element("scan-said").classList.toggle("wrong", wrong);
  }

  #begin(event) {
    event.preventDefault();
    this.#press.offer(PART);
    this.#ask({ type: "scan", name: element("scan-name").value });
  }

  async #ask(call) {
    this.#refusal = await command(call);
    if (this.#refusal) this.#say(this.#refusal, true);
  }

  async #save(event, link) {
    event.preventDefault();
    this.#say(await fetchFile(link.href), true);
  }

  /** Lift our own press once it was still. */
  #lead(phase) {
    if (!this.#led || phase !== "lift") return;
    this.#led = false;
    this.#press.release();
  }

  /** Note where a press was when it is lifted: until it has its number, the next one may be under way. */
  #notePlaces({ phase, presses, last }, before) {
    if (before?.phase === "lift" && phase !== "lift") this.#lifted.push(this.#press.place);
    if (presses > (before?.presses ?? presses) && this.#lifted.length) this.#places.set(last, this.#lifted.shift());
  }

  /** Return where the part was at a press, by its own place or that of another one, mm. */
  #placeOf(number, outlines) {
    const known = Object.keys(outlines).find((other) => this.#places.has(Number(other)));
    if (known === undefined) return [0, 0];
    return this.#places.get(Number(known)).map((mm, axis) => mm + outlines[known][0][axis] - outlines[number][0][axis]);
  }

  /** Name the sides where no press has been; on a simulated sensor each presses there. */
  #offerSides({ scanning, presses, sides, outlines }) {
    const named = scanning && presses === 0 ? [["here", [0, 0]]] : Object.entries(sides).map(([side, { shift_mm: shift }]) => [side, shift]);
    if (!this.#press.offered) {
      element("scan-sides").textContent = presses && named.length ? `not scanned yet: ${named.map(([side]) => side).join(", ")}` : "";
      return;
    }
    element("scan-sides").replaceChildren(...named.map(([side, shift]) => button(`Press ${side}`, () => this.#pressBeside(shift, outlines), "", { testid: `scan-${side}` })));
  }

  /** Press where the sensor would be moved by `shift` over the part: there the part is moved the other way. */
  #pressBeside(shift, outlines) {
    const number = Object.keys(outlines).at(-1);
    const outline = outlines[number];
    const place = outline ? this.#placeOf(number, outlines) : [0, 0];
    const half = outline ? [distance(outline[0], outline[1]) / 2, distance(outline[1], outline[2]) / 2] : [0, 0];
    this.#led = true;
    this.#press.pressAt(place.map((mm, axis) => Math.max(-half[axis], Math.min(half[axis], mm - shift[axis]))));
  }

  #drawMap({ map, version, outlines, sides, scanning }) {
    const box = element("scan-map");
    box.toggleAttribute("hidden", !map);
    if (!map) return;
    const [width, height] = map.size_mm;
    const open = scanning ? Object.values(sides).map(({ outline }) => outline) : [];
    const corners = [[0, 0], [width, height], ...open.flat()];
    const [left, top] = [0, 1].map((axis) => Math.min(...corners.map((corner) => corner[axis])) - AROUND_MM);
    const [right, bottom] = [0, 1].map((axis) => Math.max(...corners.map((corner) => corner[axis])) + AROUND_MM);
    box.setAttribute("viewBox", `${left} ${top} ${right - left} ${bottom - top}`);
    box.replaceChildren(
      shape("image", { href: `scan/map?${version}`, x: 0, y: 0, width, height, preserveAspectRatio: "none" }),
      ...open.map((outline) => shape("polygon", { points: outline.join(" "), class: "open" })),
      ...Object.values(outlines).map((outline) => shape("polygon", { points: outline.join(" "), class: "pressed" })),
      ...Object.entries(outlines).map(([number, outline]) => label(number, outline, (right - left) / 22)),
    );
  }
}

function label(text, [[left, top], , [right, bottom]], size) {
  return shape("text", { x: (left + right) / 2, y: (top + bottom) / 2, "font-size": size }, text);
}

function distance([x, y], [otherX, otherY]) {
  return Math.hypot(otherX - x, otherY - y);
}

function figuresOf({ presses, lost, map }) {
  if (!map) return "";
  const [width, height] = map.size_mm;
  const parts = [`${presses} press${presses === 1 ? "" : "es"}`, `${width.toFixed(0)} × ${height.toFixed(0)} mm`, `the gel reached ${(100 * map.reached).toFixed(0)} %`];
  if (lost.length) parts.splice(1, 0, `not joined: ${lost.join(", ")}`);
  if (typeof map.seam_um === "number") parts.push(`presses differ by ${map.seam_um.toFixed(1)} µm`);
  return parts.join("; ");
}
