// The small drawings of the wizard: a curve, the map of places, the rose of slopes.

import { shape } from "./dom.js";
import { plot, roundUp } from "./plot.js";

const FULL = 3; // presses of a place that is drawn in full colour; one is enough

/** Draw points [[x, y], ...] as a curve from 0 up. */
export function drawCurve(canvas, points, label) {
  plot(canvas, {
    x: { from: points[0][0], to: points.at(-1)[0], label },
    y: { from: 0, to: roundUp(Math.max(...points.map(([, y]) => y), 1e-6)), label: "" },
    curves: [{ points }],
  });
}

/** Draw counts of presses, rows x columns, as cells from empty to enough. */
export function drawPlaces(svg, places) {
  const [rows, columns] = [places.length, places[0].length];
  svg.setAttribute("viewBox", `0 0 ${columns * 10} ${rows * 10}`);
  svg.replaceChildren(...places.flatMap((row, y) => row.flatMap((count, x) => {
    const cell = shape("rect", { x: x * 10 + 0.4, y: y * 10 + 0.4, width: 9.2, height: 9.2, rx: 1.4, fill: tint(count / FULL) });
    const label = shape("text", { x: x * 10 + 5, y: y * 10 + 6.8, "text-anchor": "middle", "font-size": 5.2, fill: count > 1 ? "#06201e" : "#ffffff" }, String(count));
    return [cell, label];
  })));
}

/** Draw counts of pixels, directions x steepness, as sectors of a rose: gentle slopes inside, steep ones outside. */
export function drawSlopes(svg, slopes, steepnessDeg) {
  const most = Math.max(1, ...slopes.flat());
  const bands = slopes[0].length;
  const turn = (2 * Math.PI) / slopes.length;
  svg.replaceChildren(...slopes.flatMap((row, direction) => row.map((count, band) => {
    const title = shape("title", {}, `${steepnessDeg[band]} to ${steepnessDeg[band + 1]} degrees: ${count} pixels`);
    return shape("path", { d: ring(direction * turn, turn, (band / bands) * 50, ((band + 1) / bands) * 50), fill: tint(Math.sqrt(count / most)), stroke: "#11161f", "stroke-width": 0.8 }, title);
  })));
}

function ring(start, turn, inner, outer) {
  const at = (angle, radius) => `${(radius * Math.cos(angle)).toFixed(2)} ${(-radius * Math.sin(angle)).toFixed(2)}`;
  const end = start + turn;
  return `M${at(start, outer)}A${outer} ${outer} 0 0 0 ${at(end, outer)}L${at(end, inner)}A${inner} ${inner} 0 0 1 ${at(start, inner)}Z`;
}

/** From the colour of nothing to that of enough. */
function tint(share) {
  const reached = Math.min(share, 1);
  if (reached === 0) return "#1a2130";
  const mix = (from, to) => Math.round(from + (to - from) * reached);
  return `rgb(${mix(26, 76)}, ${mix(72, 201)}, ${mix(78, 192)})`;
}
