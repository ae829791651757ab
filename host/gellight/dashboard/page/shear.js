// The force along the gel: its figures, the friction cone, and the arrows over the pictures.

import { element, write } from "./dom.js";
import { fixed } from "./figures.js";

const TIMES = 5; // how much longer an arrow is than the gel has moved
const MM_PER_NEWTON = 5;

/** What `Pictures.mark` draws of one frame: an arrow for each dot, and one for the force. */
export function arrowsOf(shear) {
  if (!shear) return {};
  const arrows = shear.arrows.map(([x, y, dx, dy]) => [x, y, TIMES * dx, TIMES * dy]);
  const pull = shear.force_n && shear.centre_mm && [...shear.centre_mm, ...shear.force_n.map((newton) => MM_PER_NEWTON * newton)];
  return { arrows, pull };
}

/** Show the force along the gel, and how much of what friction holds it needs; nothing for a gel without dots. */
export function showShear(shear, force) {
  element("shear-row").hidden = !shear;
  element("cone-row").hidden = !(shear?.force_n && force?.normal_n > 0);
  if (!shear) return;
  const known = shear.force_n !== null;
  write("shear", known ? shear.force_n.map((newton) => fixed(newton, 2)).join(", ") : "unknown");
  write("shear-error", known ? `±${fixed(Math.max(...shear.force_error_n), 2)}` : "");
  write("slip", shear.slip && shear.slip !== "unknown" ? shear.slip : "");
  element("shear-row").title = known ? `torque ${fixed(shear.torque_nmm, 2)} N mm` : shear.unknown;
  element("shear-row").classList.toggle("notice", !known);
  if (!element("cone-row").hidden) showCone(Math.hypot(...shear.force_n) / force.normal_n);
}

/** Fill the gauge: 1 where the force along the gel is as large as the coefficient that the user sets lets it be. */
function showCone(ratio) {
  const coefficient = Number(element("friction").value);
  const share = coefficient > 0 ? ratio / coefficient : 1;
  element("cone").value = Math.min(share, 1);
  element("cone").title = `${fixed(ratio, 2)} of the normal force, ${fixed(100 * share, 0)} % of what friction holds`;
}
