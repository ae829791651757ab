// What lies over the pictures: the line, the place pointed at, the contacts' numbers, arrows, and the tracked object.

import { html, render, svg } from "./dom.js";
import { sizeMm } from "./field.js";

const TIMES = 5; // how much longer an arrow is than the gel has moved
const MM_PER_NEWTON = 5;
const AXIS_MM = 2;
const MOST_PLACES = 400;

export class Marks {
  #layers = [...document.querySelectorAll(".marks")];
  #number = 0; // of the tracked object
  #way = []; // the places it has come by

  /** Follow the object that is tracked, by the pose that a frame tells of it. */
  follow(pose) {
    if (!pose || pose.lost) return;
    if (pose.number !== this.#number) this.#way = [];
    this.#number = pose.number;
    this.#way = [...this.#way.slice(1 - MOST_PLACES), pose.place_mm];
  }

  /** Draw what belongs to the frame with this `header`, and the line and the point that are measured. */
  draw(header, { line, point }) {
    const [width, height] = sizeMm(header);
    const labels = header.contacts.length > 1 ? header.contacts : [];
    const paths = [...(line ? [[`M${line[0]}L${line[1]}`], ...line.map((end) => [cross(end, 0.4)])] : []),
      ...this.#moving(header.pose), ...pulls(header.shear), ...(point ? [[cross(point, 0.8)]] : [])];
    const at = (x, y) => `left: ${(x / width + 0.5) * 100}%; top: ${(y / height + 0.5) * 100}%`;
    for (const layer of this.#layers) {
      render(html`<svg viewBox="${-width / 2} ${-height / 2} ${width} ${height}" preserveAspectRatio="none">
        ${paths.map(([path, kind]) => stroke(path, kind))}</svg>${labels.map(({ number, centroid_mm: [x, y] }) => html`
        <span .style=${at(x, y)}>${number}</span>`)}`, layer);
    }
  }

  /** The axes of the tracked object, and its way. */
  #moving(pose) {
    if (!pose || pose.lost) return [];
    const [x, y] = pose.place_mm;
    const axis = ([right, down], i) => [`M${[x, y]}L${[x + AXIS_MM * right, y + AXIS_MM * down]}`, `axis-${"xyz"[i]}`];
    return [[`M${this.#way.join("L")}`], ...pose.axes.map(axis)];
  }
}

/** An arrow for each dot of the gel, and a larger one for the force along it. */
function pulls(shear) {
  if (!shear) return [];
  const arrows = shear.arrows.map(([x, y, dx, dy]) => arrow([x, y], [TIMES * dx, TIMES * dy], 0.4)).join("");
  const { force_n: newtons, centre_mm: centre } = shear;
  const pull = newtons && centre && arrow(centre, newtons.map((newton) => MM_PER_NEWTON * newton), 1);
  return [[arrows], ...(pull ? [[pull, "pull"]] : [])];
}

/** A white stroke with a dark rim, seen on every picture. */
function stroke(path, kind = "") {
  return svg`<path class="under ${kind === "pull" ? kind : ""}" d=${path}></path>
    <path class="over ${kind}" d=${path}></path>`;
}

/** An arrow with a head of so many mm; none where it would be shorter than it is wide. */
function arrow([x, y], [dx, dy], head) {
  const length = Math.hypot(dx, dy);
  if (length < head / 4) return "";
  const [ux, uy] = [dx, dy].map((part) => (part / length) * Math.min(head, length / 2));
  const tip = [x + dx, y + dy];
  const [left, right] = [1, -1].map((side) => [tip[0] - ux - (side * uy) / 2, tip[1] - uy + (side * ux) / 2]);
  return `M${x} ${y}L${tip}M${left}L${tip}L${right}`;
}

function cross([x, y], size) {
  return `M${x - size} ${y}H${x + size}M${x} ${y - size}V${y + size}`;
}
