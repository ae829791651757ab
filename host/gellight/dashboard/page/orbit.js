// Turning the surface with the pointer and coming nearer with the wheel.

import { ARROWS, clamp, onDrag, onKey } from "./hand.js";

const TURN_RAD_PER_PX = 0.008;
const STEEPEST_RAD = 1.5;
const FLATTEST_RAD = 0.15;
const START = { azimuth: -0.42, elevation: 0.8, distance: 1 };
const KEY_RAD = 0.08;
const KEY_NEARER = 0.9;

export class Orbit {
  azimuth = START.azimuth; // about the z axis, from straight below
  elevation = START.elevation; // above the gel
  distance = START.distance; // in units of what shows the whole gel
  #changed;

  /** Call `changed` after each movement on `element`. */
  constructor(element, changed) {
    this.#changed = changed;
    onDrag(element, { move: (event) => this.#turn(event.movementX, event.movementY, TURN_RAD_PER_PX) });
    element.addEventListener("wheel", (event) => {
      const scrolls = document.documentElement.scrollHeight > innerHeight;
      if (scrolls && document.activeElement !== element) return; // the wheel is the page's
      event.preventDefault();
      this.#come(Math.exp(event.deltaY * 0.001));
    }, { passive: false });
    element.addEventListener("dblclick", () => this.reset());
    onKey(element, (event) => this.#key(event));
  }

  /** Look again as at the beginning. */
  reset() {
    Object.assign(this, START);
    this.#changed();
  }

  #key({ key }) {
    if (key in ARROWS) return this.#turn(...ARROWS[key], KEY_RAD);
    return "+-".includes(key) && this.#come(key === "+" ? KEY_NEARER : 1 / KEY_NEARER);
  }

  #come(times) {
    this.distance = clamp(this.distance * times, 0.25, 2);
    this.#changed();
  }

  #turn(right, down, rad) {
    this.azimuth -= right * rad;
    this.elevation = clamp(this.elevation + down * rad, FLATTEST_RAD, STEEPEST_RAD);
    this.#changed();
  }

  /** Put `camera` where the orbit says, looking at the origin from `reach` times the distance. */
  place(camera, reach) {
    const radius = reach * this.distance;
    const [flat, high] = [radius * Math.cos(this.elevation), radius * Math.sin(this.elevation)];
    camera.position.set(flat * Math.sin(this.azimuth), -flat * Math.cos(this.azimuth), high);
    camera.up.set(0, 0, 1);
    camera.lookAt(0, 0, -0.03 * reach * Math.cos(this.elevation)); // leaves room for what rises from the gel
  }
}
