// The small drawings of the wizard: a curve, the map of places, the rose of slopes.

import { svg } from "./dom.js";
import { plot, roundUp } from "./plot.js";

const FULL = 3; // presses of a place that is drawn in full colour; one is enough

/** Draw points [[x, y], ...] as a curve from 0 up. */
export function drawCurve(chart, points, label) {
  plot(chart, {
    x: { from: points[0][0], to: points.at(-1)[0], label },
    y: { from: 0, to: roundUp(Math.max(...points.map(([, y]) => y), 1e-6)), label: "" },
    curves: [{ points }],
  });
}

/** Return cells from empty to enough, 10 x 10 units each, for counts of presses, rows x columns. */
export function placeCells(places) {
  return places.flatMap((row, y) => row.map((count, x) => svg`
    <rect x=${x * 10 + 0.4} y=${y * 10 + 0.4} width="9.2" height="9.2" rx="1.4" fill=${tint(count / FULL)}></rect>
    <text x=${x * 10 + 5} y=${y * 10 + 6.8} text-anchor="middle" font-size="5.2"
      fill=${count > 1 ? "#06201e" : "#ffffff"}>${count}</text>`));
}

/** Return the sectors of a rose for counts of pixels, directions x steepness: gentle slopes inside, steep outside. */
export function slopeSectors(slopes, steepnessDeg) {
  const most = Math.max(1, ...slopes.flat());
  const width = 50 / slopes[0].length;
  const turn = (2 * Math.PI) / slopes.length;
  return slopes.flatMap((row, direction) => row.map((count, band) => svg`
    <path d=${sector(direction * turn, turn, band * width, (band + 1) * width)} fill=${tint(Math.sqrt(count / most))}
      stroke="#11161f" stroke-width="0.8">
      <title>${steepnessDeg[band]} to ${steepnessDeg[band + 1]} degrees: ${count} pixels</title></path>`));
}

function sector(start, turn, inner, outer) {
  const at = (angle, radius) => `${(radius * Math.cos(angle)).toFixed(2)} ${(-radius * Math.sin(angle)).toFixed(2)}`;
  const end = start + turn;
  const [out, back] = [`A${outer} ${outer} 0 0 0 ${at(end, outer)}`, `A${inner} ${inner} 0 0 1 ${at(start, inner)}`];
  return `M${at(start, outer)}${out}L${at(end, inner)}${back}Z`;
}

/** From the colour of nothing to that of enough. */
function tint(share) {
  const reached = Math.min(share, 1);
  if (reached === 0) return "#1a2130";
  const mix = (from, to) => Math.round(from + (to - from) * reached);
  return `rgb(${mix(26, 76)}, ${mix(72, 201)}, ${mix(78, 192)})`;
}
