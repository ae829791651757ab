// Turning the surface with the pointer and coming nearer with the wheel.

const TURN_RAD_PER_PX = 0.008;
const STEEPEST_RAD = 1.5;
const FLATTEST_RAD = 0.15;

export class Orbit {
  azimuth = -0.42; // about the z axis, from straight below
  elevation = 0.8; // above the gel
  distance = 1; // in units of what shows the whole gel

  /** Call `changed` after each movement on `element`. */
  constructor(element, changed) {
    element.addEventListener("pointerdown", (event) => element.setPointerCapture(event.pointerId));
    element.addEventListener("pointermove", (event) => {
      if (!element.hasPointerCapture(event.pointerId)) return;
      this.#turn(event.movementX, event.movementY);
      changed();
    });
    element.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.distance = clamp(this.distance * Math.exp(event.deltaY * 0.001), 0.25, 2);
      changed();
    }, { passive: false });
  }

  #turn(dx, dy) {
    this.azimuth -= dx * TURN_RAD_PER_PX;
    this.elevation = clamp(this.elevation + dy * TURN_RAD_PER_PX, FLATTEST_RAD, STEEPEST_RAD);
  }

  /** Put `camera` where the orbit says, looking at the origin from `reach` times the distance. */
  place(camera, reach) {
    const radius = reach * this.distance;
    const flat = radius * Math.cos(this.elevation);
    camera.position.set(flat * Math.sin(this.azimuth), -flat * Math.cos(this.azimuth), radius * Math.sin(this.elevation));
    camera.up.set(0, 0, 1);
    camera.lookAt(0, 0, -0.03 * reach * Math.cos(this.elevation)); // leaves room for what rises from the gel
  }
}

function clamp(value, low, high) {
  return Math.min(Math.max(value, low), high);
}
